"""Whether a rover moves that nobody drives, judged by where it really is."""

from collections.abc import Iterator
from math import hypot

from rover_sim.personas import Mode
from rover_sim.vehicle import Vehicle
from tests.kit.observer import Observer

STANDS = 0.02  # m/s and rad/s
BRAKING = 1.5  # s, from the highest speed that is driven here to a stand
ROLLING = 2.5  # s, the same of one that is disarmed on the way: 0.5 m/s² from 1 m/s
STOP_BOUND = 1.5  # s from when the server reads a STOP, where the rover hears it
STOP_BOUND_UNHEARD = 3.0 + BRAKING  # s, where it does not: by its own time-out
#: s that it must have moved: a mode of its own that is turned to and away from between two looks
FLASH = 0.1
UNHEARD = 6.0  # s after something was wrong with the way to the rover
BY_ITSELF = frozenset({Mode.MANUAL, Mode.POSITION, Mode.AUTO, Mode.RTL})


class Stillness:
    """Watches one rover's true motion."""

    def __init__(self, vehicle: Vehicle, observer: Observer) -> None:
        self.vehicle = vehicle
        self.observer = observer
        #: when the way from the server to the rover, or the rover itself, was last not as it should
        self.disturbed_at = -1e9
        self._by_itself_at = -1e9
        self._stood_at = -1e9

    def look(self, now: float) -> Iterator[str]:
        """Yield what is wrong now."""
        autopilot = self.vehicle.autopilot
        if autopilot.armed and autopilot.mode in BY_ITSELF:
            self._by_itself_at = now
        truth = self.vehicle.truth
        speed = max(hypot(truth.forward_speed, truth.lateral_speed), abs(truth.yaw_rate))
        if speed <= STANDS:
            self._stood_at = now
        coasts = BRAKING if autopilot.armed else ROLLING
        if now - self._stood_at <= FLASH or now - self._by_itself_at <= coasts:
            return
        number, observer = self.observer.system_id, self.observer
        if now > observer.may_move_until + BRAKING:
            yield f"rover {number} moves, {speed:.2f}, and nobody drives it"
        heard = now - self.disturbed_at > UNHEARD
        bound = STOP_BOUND if heard else STOP_BOUND_UNHEARD
        if observer.stopped and now - observer.stopped_at > bound and not self._is_pushed(now):
            yield f"rover {number} moves, {speed:.2f}, {now - observer.stopped_at:.2f} s after STOP"

    def _is_pushed(self, now: float) -> bool:
        """Whether another station, past the server, has sent it somewhere."""
        return self.observer.may_move_until > now + BRAKING + 3.0
