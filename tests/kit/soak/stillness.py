"""Checks that an undriven rover stands, by its true motion."""

from collections.abc import Iterator
from math import hypot

from rover_sim.personas import Mode
from rover_sim.vehicle import Vehicle
from tests.kit.observer import Observer

STANDS = 0.02  # m/s and rad/s
BRAKING = 1.5  # s, from the highest speed here to standstill
ROLLING = 2.5  # s, if disarmed on the way: 0.5 m/s² from 1 m/s
STOP_BOUND = 1.5  # s from the server's reading of a STOP, if the rover hears it
STOP_BOUND_UNHEARD = 3.0 + BRAKING  # s, if it does not: by its own time-out
#: s of motion until it counts: a mode may be entered and left between two checks
FLASH = 0.1
UNHEARD = 6.0  # s after a fault on the way to the rover
BY_ITSELF = frozenset({Mode.MANUAL, Mode.POSITION, Mode.AUTO, Mode.RTL})


class Stillness:
    """Checks one rover's true motion."""

    def __init__(self, vehicle: Vehicle, observer: Observer) -> None:
        self.vehicle = vehicle
        self.observer = observer
        #: time of the last fault of the rover, or of the way to it
        self.disturbed_at = -1e9
        self._by_itself_at = -1e9
        self._stood_at = -1e9

    def look(self, now: float) -> Iterator[str]:
        """Yield the present violations."""
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
        """Return whether another station has sent the rover somewhere, bypassing the server."""
        return self.observer.may_move_until > now + BRAKING + 3.0
