"""Modes, arming and failsafe of ArduPilot Rover, as observed on 4.6.3.

Any mode can be entered while disarmed. Arming needs a settled estimate. In a mode that drives by
itself, the rover starts to drive as soon as it is armed.
"""

from mav_tasks.mavlink.enums import MavSeverity, MavState
from rover_sim.estimate import Estimate
from rover_sim.failsafe import OperatorFailsafe
from rover_sim.flight_rules import FlightParts, Intervention
from rover_sim.guided import Guided
from rover_sim.modes import Mode
from rover_sim.route import Route, square_around
from rover_sim.setpoints import Destination, Global, Local, Target
from rover_sim.steering import HOLD, Demand, arc_to_point, steer_to_point

REACHED_RADIUS = 0.3  # m, around each mission item


class ArduPilotRules:
    """ArduPilot Rover's rules; implements ``FlightRules``."""

    reposition_mode = Mode.GUIDED
    sticks_present = False
    no_position_text = "Arm: Need Position Estimate"
    hold_destination: Destination | None = None  # HOLD stops the rover; it drives to no place

    def __init__(self, parts: FlightParts) -> None:
        self._parts = parts
        self._steer = steer_to_point if parts.frame.turns_on_the_spot else arc_to_point
        self._outbox = parts.outbox
        self._guided = Guided(
            origin=parts.origin,
            outbox=parts.outbox,
            speed_limit=parts.speed_limit,
            steer=self._steer,
        )
        self._failsafe = OperatorFailsafe(parts.parameters)

    def __repr__(self) -> str:
        return f"ArduPilotRules({self._guided!r}, {self._failsafe!r})"

    @property
    def target(self) -> Target | None:
        """The target of the setpoints, in GUIDED."""
        return self._guided.target

    @property
    def cruise_speed(self) -> float:
        """Speed of AUTO and RTL, m/s."""
        return self._parts.speed_limit()

    def system_status(self, mode: Mode, *, armed: bool) -> MavState:
        """Return MAV_STATE as Rover derives it: from failsafe and mode, not from arming."""
        del armed
        if self._failsafe.tripped:
            return MavState.CRITICAL
        if mode is Mode.INITIALISING:
            return MavState.CALIBRATING
        return MavState.STANDBY if mode is Mode.HOLD else MavState.ACTIVE

    def arming_text(self, *, armed: bool) -> str:
        """Return the text that reports arming or disarming."""
        return "Throttle armed" if armed else "Throttle disarmed"

    def unknown_mode(self, custom_mode: int) -> str:
        """Return the text for a mode number that does not exist."""
        return f"No such mode {custom_mode}"

    def mode_refusal(self, wanted: Mode, present: Mode, *, armed: bool, now: float) -> str | None:
        """Return a refusal if INITIALISING would be entered or left, else None."""
        del armed, now
        return "Flight mode change failed" if Mode.INITIALISING in (wanted, present) else None

    def arming_refusal(self, mode: Mode, *, forced: bool, now: float) -> str | None:
        """Return a refusal during the settling time, unless arming is forced, else None."""
        del mode
        if not forced and now - self._parts.started < self._parts.settling_time:
            return "Arm: AHRS: not using configured AHRS type"
        return None

    def intended(self, mode: Mode) -> Mode:
        """Return the present mode: on ArduPilot a failsafe changes the intended mode, too."""
        return mode

    def choose(self, mode: Mode) -> None:
        """Do nothing: ArduPilot behaves alike, no matter who chose the mode."""

    def enter(self, mode: Mode) -> None:
        """Forget the target on entering GUIDED."""
        if mode is Mode.GUIDED:
            self._guided.clear()

    def intervene(
        self, mode: Mode, *, armed: bool, arrived: bool, now: float
    ) -> Intervention | None:
        """Enter HOLD when the ground station's heartbeats stop, if that failsafe is enabled."""
        del mode, arrived
        if not self._failsafe.changed(now=now):
            return None
        if not self._failsafe.tripped:
            self._outbox.say(MavSeverity.INFO, "GCS Failsafe Cleared")
            return None
        # Rover 4.6.3 says Radio, because the RC check shares the failsafe bits.
        self._outbox.say(MavSeverity.WARNING, "Radio Failsafe")
        return Intervention(Mode.HOLD) if armed else None

    def position_lost(self) -> Intervention:
        """Enter HOLD, as FS_EKF_ACTION = 1 does."""
        self._outbox.say(MavSeverity.CRITICAL, "EKF failsafe")
        return Intervention(Mode.HOLD)

    def fence_breached(self) -> Intervention:
        """Enter HOLD: FENCE_ACTION is 2 here, as 1 drives home. 4.6.3 tells SYS_STATUS only."""
        return Intervention(Mode.HOLD)

    def hear_heartbeat(self, system_id: int, *, now: float) -> None:
        """Note a heartbeat from any system."""
        self._failsafe.hear_heartbeat(system_id, now=now)

    def take_local(self, message: Local, estimate: Estimate, *, mode: Mode, now: float) -> None:
        """Take a setpoint in GUIDED; drop it silently in other modes."""
        if mode is Mode.GUIDED:
            self._guided.take_local(message, estimate, now=now)

    def take_global(self, message: Global, estimate: Estimate, *, mode: Mode, now: float) -> None:
        """Take a setpoint in GUIDED; drop it silently in other modes."""
        del estimate
        if mode is Mode.GUIDED:
            self._guided.take_global(message, now=now)

    def go_to(self, destination: Destination | None, *, now: float) -> None:
        """Take a destination; ignore None ("here"), which ArduPilot does not know."""
        if destination is not None:
            self._guided.go_to(destination, now=now)

    def change_speed(self, speed: float, mode: Mode) -> bool:
        """Set the speed towards a destination; NaN aborts in any mode. Return False if refused."""
        return self._guided.change_speed(speed) and mode is Mode.GUIDED

    def follow_setpoints(self, estimate: Estimate, *, now: float) -> Demand:
        """Return the demand in GUIDED."""
        return self._guided.demand(estimate, now=now)

    def steer_to(self, estimate: Estimate, place: Destination, speed_limit: float) -> Demand | None:
        """Return the demand in AUTO and RTL, or None on arrival."""
        return self._steer(estimate, *place, speed_limit, radius=REACHED_RADIUS)

    def hold(self, estimate: Estimate) -> Demand:
        """Return the demand that stops the rover."""
        del estimate
        return HOLD

    def mission_route(self, home: Destination) -> Route | None:
        """Return the stored mission from its beginning, or else the built-in square."""
        return self._parts.missions.route() or square_around(home)
