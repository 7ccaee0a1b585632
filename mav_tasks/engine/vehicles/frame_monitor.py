"""Which local frame a vehicle's positions are in, and where its home is.

The origin is what GPS_GLOBAL_ORIGIN says. A vehicle that never says it has its origin worked out
from GLOBAL_POSITION_INT and LOCAL_POSITION_NED of nearly the same instant. Home alone says nothing:
it is a place, and no autopilot promises that its frame begins there.
"""

from math import hypot

from mav_tasks.mavlink import messages as m
from mav_tasks.tasks.frames import origin_of, to_local
from mav_tasks.tasks.goal import GlobalPlace, LocalPlace
from mav_tasks.tasks.task import Frame

MOVED_SAID = 0.05  # m between two origins that a vehicle says, that are not the same
MOVED_WORKED_OUT = 1.0  # m, the same where positions were rounded and filtered in between
#: s between two messages of which the origin is worked out: a PX4 1.17 sends them 24 to 80 ms apart
APART = 0.1
MAX_LATITUDE_DEGE7 = 900_000_000
MAX_LONGITUDE_DEGE7 = 1_800_000_000

Seen = m.GpsGlobalOrigin | m.HomePosition | m.GlobalPositionInt | m.LocalPositionNed | m.Attitude


class FrameMonitor:
    """What one vehicle says of its frame."""

    def __init__(self) -> None:
        self._origin: GlobalPlace | None = None
        self._is_said = False
        self._booted_at: float | None = None
        self._heard_at = 0.0  # when that was worked out
        self._global: m.GlobalPositionInt | None = None
        self._local: m.LocalPositionNed | None = None
        self.home: GlobalPlace | None = None
        #: the origin is another one than before; whoever reads it sets it back
        self.changed = False

    def __repr__(self) -> str:
        return f"FrameMonitor({self._origin}, home {self.home})"

    @property
    def origin(self) -> GlobalPlace | None:
        """Where the frame begins on earth, if that is known."""
        return self._origin

    def boot(self, booted_at: float, *, now: float) -> None:
        """Take note of when the vehicle was started, by its clock."""
        self._booted_at, self._heard_at = booted_at, now

    def receive(self, message: Seen) -> None:
        """Take a message in; one with an impossible place is dropped."""
        match message:
            case m.GpsGlobalOrigin():
                self._set_origin(_place(message), is_said=True)
            case m.HomePosition():
                self.home = _place(message) or self.home
            case m.GlobalPositionInt():
                self._global = message
                self._work_out()
            case m.LocalPositionNed():
                self._local = message
                self._work_out()

    def frame(self) -> Frame | None:
        """Return the frame, or None before anything was heard of it."""
        if self._booted_at is None:
            return None
        if self._origin is None:
            return Frame(None, None, self._booted_at, self._heard_at)
        latitude, longitude = self._origin.latitude_degE7, self._origin.longitude_degE7
        return Frame(latitude, longitude, self._booted_at, self._heard_at)

    def forget(self) -> None:
        """Start afresh, as after a restart of the vehicle."""
        self._origin = self._global = self._local = None
        self._is_said = False
        self._booted_at = None
        self.changed = False

    def _work_out(self) -> None:
        where, local = self._global, self._local
        if self._is_said or where is None or local is None:
            return
        later = (where.time_boot_ms - local.time_boot_ms) / 1000
        # between two instants a position may have been corrected: that is no other origin
        if abs(later) > (APART if self._origin is None else 0.0):
            return
        place = _place(where)
        if place is not None:
            there = LocalPlace(local.x + later * local.vx, local.y + later * local.vy)
            self._set_origin(origin_of(place, there), is_said=False)

    def _set_origin(self, origin: GlobalPlace | None, *, is_said: bool) -> None:
        if origin is None:
            return
        if self._origin is not None:
            apart = to_local(origin, self._origin)
            exact = is_said and self._is_said
            if hypot(apart.north, apart.east) <= (MOVED_SAID if exact else MOVED_WORKED_OUT):
                if is_said and not self._is_said:
                    self._origin, self._is_said = origin, True
                return
            self.changed = True
        self._origin, self._is_said = origin, is_said


def _place(message: m.GpsGlobalOrigin | m.HomePosition | m.GlobalPositionInt) -> GlobalPlace | None:
    """Return the place that a message names; None if there is none such, or it is not known."""
    if isinstance(message, m.GlobalPositionInt):
        latitude, longitude = message.lat, message.lon
    else:
        latitude, longitude = message.latitude, message.longitude
    if latitude == longitude == 0:  # "not known" of many autopilots
        return None
    if abs(latitude) > MAX_LATITUDE_DEGE7 or abs(longitude) > MAX_LONGITUDE_DEGE7:
        return None
    return GlobalPlace(latitude, longitude)
