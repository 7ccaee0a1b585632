"""Where a vehicle is, how it moves, where its local frame begins, and where home and fence are.

The origin is what GPS_GLOBAL_ORIGIN says. If a vehicle never sends it, the origin is computed from
GLOBAL_POSITION_INT and LOCAL_POSITION_NED of nearly the same instant. Home does not define it: home
is a place, and no autopilot promises that its frame begins there.
"""

from collections.abc import Sequence
from math import hypot, inf

from mav_tasks.config.settings import Watch
from mav_tasks.engine.vehicles.motion_monitor import MotionMonitor
from mav_tasks.engine.vehicles.sender_clock import Heard, Stamped
from mav_tasks.kinds import GlobalPlace, GoTo, LocalPlace
from mav_tasks.kinds.path import distance
from mav_tasks.mavlink.messages import Attitude, GlobalPositionInt, GpsGlobalOrigin, HomePosition
from mav_tasks.tasks.driving.bounds import Bounds
from mav_tasks.tasks.driving.frames import local_place, origin_of, to_local
from mav_tasks.tasks.goal import Step
from mav_tasks.tasks.task import Frame

MOVED_SAID = 0.05  # m between two reported origins that count as different
MOVED_WORKED_OUT = 1.0  # m, the same for computed ones: positions are rounded and filtered
#: s between two messages that give the origin: a PX4 1.17 sends them 24 to 80 ms apart
APART = 0.1
MAX_LATITUDE_DEGE7 = 900_000_000
MAX_LONGITUDE_DEGE7 = 1_800_000_000


class VehiclePosition(MotionMonitor):
    """The position data of one vehicle, and what follows from it."""

    def __init__(self, watch: Watch, bounds: Bounds) -> None:
        super().__init__(watch)
        self._bounds = bounds

    def __repr__(self) -> str:
        return f"VehiclePosition({self.latest()}, origin={self.origin})"

    def forget(self) -> None:
        """Forget all position data, but not the noise, after a restart of the vehicle."""
        super().forget()
        #: the global position of the frame's origin, or None if it is unknown
        self.origin: GlobalPlace | None = None
        self._is_said = False
        self._booted: tuple[float, float] | None = None  # when, and when that was determined
        self._global: GlobalPositionInt | None = None
        #: what HOME_POSITION says; None: nothing since the vehicle booted
        self.said_home: GlobalPlace | None = None
        #: the origin has changed; the reader resets this flag
        self.has_moved_frame = False

    def receive(self, message: Stamped, *, now: float, not_after: float = inf) -> Heard:
        """Process a message and return its classification; an old message is dropped.

        A message that is read late counts as sent at ``not_after`` at the latest.
        """
        if isinstance(message, GlobalPositionInt):
            heard = self.clock.hear(message, now=now)
        else:
            heard = super().receive(message, now=now, not_after=not_after)
        if heard is Heard.NEWS:
            self._booted = self.clock.booted, now
            if isinstance(message, GlobalPositionInt):
                self._global = message
            if not isinstance(message, Attitude):
                self._work_out()
        return heard

    def receive_place(self, message: GpsGlobalOrigin | HomePosition) -> None:
        """Process where the frame begins, or home is; an impossible place is ignored."""
        place = _place(message.latitude, message.longitude)
        if isinstance(message, HomePosition):
            self.said_home = place or self.said_home
        else:
            self._set_origin(place, is_said=True)

    def frame(self) -> Frame | None:
        """Return the frame, or None before the boot time is known."""
        if self._booted is None:
            return None
        if self.origin is None:
            return Frame(None, None, *self._booted)
        return Frame(self.origin.latitude_degE7, self.origin.longitude_degE7, *self._booted)

    @property
    def home(self) -> GlobalPlace | None:
        """The place to which the vehicle returns: the nearest rally point, else its home."""
        motion = self.latest()
        rally = None if motion is None else self._bounds.refuge(motion.pose, self.origin)
        return rally or self.said_home

    @property
    def is_fence_unknown(self) -> bool:
        """Whether there is a fence whose place in the vehicle's frame is unknown."""
        return self._bounds.is_unknown(self.origin)

    def distance_to(self, goal: GoTo) -> float | None:
        """Return the metres to the place of a goal, or None if that is unknown."""
        motion, place = self.latest(), self._place_of(goal)
        return None if motion is None or place is None else distance(motion.pose, place)

    def is_within_fence(self, goal: GoTo) -> bool:
        """Return whether the fence allows the place of a goal; True if that is unknown."""
        fence, place = self._bounds.local(self.origin), self._place_of(goal)
        return fence is None or place is None or fence.allows(place)

    def leg_over_fence(self, steps: Sequence[Step]) -> int | None:
        """Return a step of a plan whose straight line crosses the fence, or None."""
        return self._bounds.forbidden_leg(steps, self.origin)

    def _place_of(self, goal: GoTo) -> LocalPlace | None:
        return local_place(self.home if goal.place is None else goal.place, self.origin)

    def _work_out(self) -> None:
        where, local = self._global, self._position
        if self._is_said or where is None or local is None:
            return
        later = (where.time_boot_ms - local.time_boot_ms) / 1000
        # between two instants a position may have been corrected, which does not change the origin
        if abs(later) > (APART if self.origin is None else 0.0):
            return
        if place := _place(where.lat, where.lon):
            there = LocalPlace(local.x + later * local.vx, local.y + later * local.vy)
            self._set_origin(origin_of(place, there), is_said=False)

    def _set_origin(self, origin: GlobalPlace | None, *, is_said: bool) -> None:
        if origin is None:
            return
        if self.origin is not None:
            apart = to_local(origin, self.origin)
            most = MOVED_SAID if is_said and self._is_said else MOVED_WORKED_OUT
            is_same = hypot(apart.north, apart.east) <= most
            if is_same and (self._is_said or not is_said):
                return
            self.has_moved_frame |= not is_same
        self.origin, self._is_said = origin, is_said


def _place(latitude: int, longitude: int) -> GlobalPlace | None:
    """Return a place in 1e-7 deg, or None if it is impossible or unknown."""
    if latitude == longitude == 0:  # many autopilots send this for "unknown"
        return None
    if abs(latitude) > MAX_LATITUDE_DEGE7 or abs(longitude) > MAX_LONGITUDE_DEGE7:
        return None
    return GlobalPlace(latitude, longitude)
