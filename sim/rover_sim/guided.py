"""GUIDED mode: one target, its time-out, and the demand for it."""

import math
from collections.abc import Callable

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.enums import MavSeverity
from rover_sim.errors import SimulatedCrash
from rover_sim.estimate import Estimate
from rover_sim.geo import Origin
from rover_sim.outbox import Outbox
from rover_sim.setpoints import (
    Destination,
    Global,
    Heading,
    Local,
    Target,
    TurnRate,
    read_global,
    read_local,
)
from rover_sim.steering import STOP, Demand, SteerToPoint, steer_to_heading

SETPOINT_TIMEOUT = 3.0  # s, a constant in ArduPilot's mode_guided.cpp
ARRIVAL_RADIUS = 0.1  # m; nearer than this the rover only brakes


class Guided:
    """Keeps the last target, armed or not: if armed within its time-out, the rover drives off."""

    def __init__(
        self,
        *,
        origin: Origin,
        outbox: Outbox,
        speed_limit: Callable[[], float],
        steer: SteerToPoint,
    ) -> None:
        self._steer = steer
        self._origin = origin
        self._outbox = outbox
        self._speed_limit = speed_limit
        self._target: Target | None = None
        self._taken_at = 0.0
        self._destination_speed: float | None = None

    def __repr__(self) -> str:
        return f"Guided({self._target})"

    @property
    def target(self) -> Target | None:
        """The last target, until it is reached, times out or is cleared."""
        return self._target

    def clear(self) -> None:
        """Forget the target; called only on entering the mode."""
        self._target = None

    def take_local(self, message: Local, estimate: Estimate, *, now: float) -> None:
        """Take SET_POSITION_TARGET_LOCAL_NED."""
        self._take(read_local(message, estimate, speed_limit=self._speed_limit()), now)

    def take_global(self, message: Global, *, now: float) -> None:
        """Take SET_POSITION_TARGET_GLOBAL_INT."""
        self._take(read_global(message, self._origin, speed_limit=self._speed_limit()), now)

    def go_to(self, destination: Destination, *, now: float) -> None:
        """Take a destination from a command."""
        self._take(destination, now)

    def change_speed(self, speed: float) -> bool:
        """Set the speed towards a destination; return False without one, or for speed < 0."""
        if math.isnan(speed):
            raise SimulatedCrash("NaN in DO_CHANGE_SPEED: ArduPilot aborts")
        if speed < 0.0 or not isinstance(self._target, Destination):
            return False
        self._destination_speed = speed
        return True

    def demand(self, estimate: Estimate, *, now: float) -> Demand:
        """Return the demand; the time-out also runs while disarmed."""
        match self._target:
            case None:
                return STOP
            case Destination(north, east):
                return self._drive_to(estimate, north, east)
            case Heading() | TurnRate() if now - self._taken_at > SETPOINT_TIMEOUT:
                self._target = None
                text = "target not received last 3secs, stopping"
                self._outbox.say(MavSeverity.WARNING, text)
                return STOP
            case Heading(yaw, speed):
                return steer_to_heading(estimate, yaw, speed)
            case TurnRate(yaw_rate, speed):
                return Demand(speed, yaw_rate)

    def _take(self, target: Target | None, now: float) -> None:
        if target is None:
            return
        if isinstance(target, Destination) and target != self._target:
            self._destination_speed = None
        self._target = target
        self._taken_at = now

    def _drive_to(self, estimate: Estimate, north: float, east: float) -> Demand:
        speed = self._destination_speed
        limit = self._speed_limit() if speed is None else min(speed, self._speed_limit())
        demand = self._steer(estimate, north, east, limit, radius=ARRIVAL_RADIUS)
        if demand is not None:
            return demand
        self._target = None
        # The real one sends this for a guided target, too, although no mission runs.
        self._outbox.send(messages.MissionItemReached(0))
        return STOP
