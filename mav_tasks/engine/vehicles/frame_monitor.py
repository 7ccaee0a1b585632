"""Which local frame a vehicle's positions are in, and where its home is.

The origin is what GPS_GLOBAL_ORIGIN says. If a vehicle never sends it, the origin is computed from
GLOBAL_POSITION_INT and LOCAL_POSITION_NED of nearly the same instant. Home does not define it: home
is a place, and no autopilot promises that its frame begins there.
"""

from math import hypot

from mav_tasks.mavlink import messages as m
from mav_tasks.tasks.frames import origin_of, to_local
from mav_tasks.tasks.goal import GlobalPlace, LocalPlace
from mav_tasks.tasks.task import Frame

MOVED_SAID = 0.05  # m between two reported origins that count as different
MOVED_WORKED_OUT = 1.0  # m, the same for computed ones: positions are rounded and filtered
#: s between two messages that give the origin: a PX4 1.17 sends them 24 to 80 ms apart
APART = 0.1
MAX_LATITUDE_DEGE7 = 900_000_000
MAX_LONGITUDE_DEGE7 = 1_800_000_000

Seen = m.GpsGlobalOrigin | m.HomePosition | m.GlobalPositionInt | m.LocalPositionNed | m.Attitude


class FrameMonitor:
    """What one vehicle reports about its local frame."""

    def __init__(self) -> None:
        #: the global position of the frame's origin, or None if it is unknown
        self.origin: GlobalPlace | None = None
        self._is_said = False
        self._booted_at: float | None = None
        self._heard_at = 0.0  # when the boot time was determined
        self._global: m.GlobalPositionInt | None = None
        self._local: m.LocalPositionNed | None = None
        #: what HOME_POSITION says; None: nothing since the vehicle booted
        self.home: GlobalPlace | None = None
        #: the origin has changed; the reader resets this flag
        self.changed = False

    def __repr__(self) -> str:
        return f"FrameMonitor({self.origin}, home {self.home})"

    def boot(self, booted_at: float, *, now: float) -> None:
        self._booted_at, self._heard_at = booted_at, now

    def receive(self, message: Seen) -> None:
        """Process a message; an impossible place is ignored."""
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
        """Return the frame, or None before the boot time is known."""
        if self._booted_at is None:
            return None
        if self.origin is None:
            return Frame(None, None, self._booted_at, self._heard_at)
        latitude, longitude = self.origin.latitude_degE7, self.origin.longitude_degE7
        return Frame(latitude, longitude, self._booted_at, self._heard_at)

    def forget(self) -> None:
        """Forget the frame, as after a restart of the vehicle."""
        self.origin = self.home = self._global = self._local = None
        self._is_said = False
        self._booted_at = None
        self.changed = False

    def _work_out(self) -> None:
        where, local = self._global, self._local
        if self._is_said or where is None or local is None:
            return
        later = (where.time_boot_ms - local.time_boot_ms) / 1000
        # between two instants a position may have been corrected, which does not change the origin
        if abs(later) > (APART if self.origin is None else 0.0):
            return
        if place := _place(where):
            there = LocalPlace(local.x + later * local.vx, local.y + later * local.vy)
            self._set_origin(origin_of(place, there), is_said=False)

    def _set_origin(self, origin: GlobalPlace | None, *, is_said: bool) -> None:
        if origin is None:
            return
        if self.origin is not None:
            apart = to_local(origin, self.origin)
            exact = is_said and self._is_said
            if hypot(apart.north, apart.east) <= (MOVED_SAID if exact else MOVED_WORKED_OUT):
                if is_said and not self._is_said:
                    self.origin, self._is_said = origin, True
                return
            self.changed = True
        self.origin, self._is_said = origin, is_said


def _place(message: m.GpsGlobalOrigin | m.HomePosition | m.GlobalPositionInt) -> GlobalPlace | None:
    """Return the place that a message names, or None if it is impossible or unknown."""
    if isinstance(message, m.GlobalPositionInt):
        latitude, longitude = message.lat, message.lon
    else:
        latitude, longitude = message.latitude, message.longitude
    if latitude == longitude == 0:  # many autopilots send this for "unknown"
        return None
    if abs(latitude) > MAX_LATITUDE_DEGE7 or abs(longitude) > MAX_LONGITUDE_DEGE7:
        return None
    return GlobalPlace(latitude, longitude)
