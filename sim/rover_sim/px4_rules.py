"""The rules of a PX4 1.17 rover, including its surprises.

Recorded and tried on 1.17.0. It differs from PX4's guide, in ways that matter to a controller:

- A velocity is a speed and a course, atan2(east, north). Zero velocity is a course, too: north for
  plain zeros, or south if a zero is negative (0.0 * cos of a southerly heading). A differential
  rover turns to it on the spot, an Ackermann rover bends while it brakes.
- It never drives backwards: it turns round while it drives.
- When setpoints end, the table in ``px4_failsafe`` applies after COM_OF_LOSS_T; by default the
  rover drives home.
- HOLD keeps the place where it began: a rover that rolled beyond NAV_ACC_RAD drives back to it.
- After a return it counts as landed, and disarms itself.
- While disarmed it accepts any mode; it is not armed in one that cannot run.

Not modelled: failsafes of data link, battery, fence and estimator; the 5 s of Hold before RTL
(COM_FAIL_ACT_T); loss of sticks, which are absent until a test holds them.

Texts fit into one STATUSTEXT and lack the tab at the end of the real ones (PX4 sends an EVENT
beside each, so that a ground station drops the text).
"""

import math
from collections.abc import Mapping

from mav_tasks.mavlink.enums import MavSeverity, MavState
from rover_sim.estimate import Estimate
from rover_sim.flight_rules import FlightParts, Intervention
from rover_sim.modes import Mode
from rover_sim.offboard import Offboard
from rover_sim.px4_failsafe import INTERVENTIONS, action_on_loss
from rover_sim.px4_guidance import Px4Guidance
from rover_sim.px4_landing import Landing
from rover_sim.px4_setpoints import Setpoint, read_px4_global, read_px4_local
from rover_sim.route import Route
from rover_sim.setpoints import Destination, Global, Heading, Local, Target, TurnRate
from rover_sim.steering import HOLD, STOP, Demand

RETURNS_OVER = 60.0  # m, RTL_RETURN_ALT: only for the text, as no rover rises
DESTINATION_TEXT = "RTL: land at destination"

NAMES: Mapping[Mode, str] = {
    Mode.MANUAL: "Manual",
    Mode.POSITION: "Position",
    Mode.HOLD: "Hold",
    Mode.AUTO: "Mission",
    Mode.RTL: "Return",
    Mode.LAND: "Land",
    Mode.GUIDED: "Offboard",
}


class Px4Rules:
    """Implements ``FlightRules``."""

    reposition_mode = Mode.HOLD
    sticks_present = False
    no_position_text = "Arming denied: Resolve system health failures first"

    def __init__(self, parts: FlightParts) -> None:
        self._parts = parts
        self._offboard = Offboard()
        self._intended = Mode.HOLD  # the last requested mode; a failsafe does not change it
        self._failing = False
        self._place: Destination | None = None
        self._cruise: float | None = None  # m/s, from DO_CHANGE_SPEED
        self._guidance = Px4Guidance(parts.frame, parts.parameters)
        self._landing = Landing(parts.outbox)
        self._held_at: Destination | None = None  # where HOLD began; None: set at the next step

    def __repr__(self) -> str:
        return f"Px4Rules({self._intended.name}, {self._offboard!r})"

    @property
    def target(self) -> Target | None:
        """The target of the setpoints, in OFFBOARD."""
        return self._offboard.target

    @property
    def hold_destination(self) -> Destination | None:
        """The place of DO_REPOSITION, or None."""
        return self._place

    @property
    def cruise_speed(self) -> float:
        """Speed of the modes that drive by themselves, m/s."""
        limit = self._parts.speed_limit()
        return limit if self._cruise is None else min(self._cruise, limit)

    def system_status(self, mode: Mode, *, armed: bool) -> MavState:
        """Return MAV_STATE, from failsafe and arming, not from the mode."""
        del mode
        if self._failing:
            return MavState.CRITICAL
        return MavState.ACTIVE if armed else MavState.STANDBY

    def arming_text(self, *, armed: bool) -> str:
        """Return the text that reports arming or disarming."""
        return "Armed by external command" if armed else "Disarmed by external command"

    def unknown_mode(self, custom_mode: int) -> str:
        """Return the text for a mode number that does not exist."""
        return f"Unsupported mode {custom_mode:#010x}"

    def mode_refusal(self, wanted: Mode, present: Mode, *, armed: bool, now: float) -> str | None:
        """Return a refusal for a mode that cannot run now, if it is armed."""
        del present
        if not armed or self._can_run(wanted, now):
            return None
        return f"Switching to {NAMES[wanted]} is currently not available"

    def arming_refusal(self, mode: Mode, *, forced: bool, now: float) -> str | None:
        """Return a refusal while settling or in a mode that cannot run; ignore ``forced``."""
        del forced
        if now - self._parts.started < self._parts.settling_time:
            return "Arming denied: health checks not passed yet"
        if not self._can_run(mode, now):
            return f"Arming denied: {NAMES[mode]} cannot run"
        return None

    def intended(self, mode: Mode) -> Mode:
        """Return the last requested mode."""
        del mode
        return self._intended

    def choose(self, mode: Mode) -> None:
        """Note a requested mode: this ends a failsafe, even in the same mode."""
        self._intended = mode
        self._failing = False

    def enter(self, mode: Mode) -> None:
        """Begin a mode; keep the last setpoint for a return to OFFBOARD.

        HOLD keeps the rover's place at its first step.
        """
        del mode
        self._place = self._cruise = self._held_at = None

    def intervene(
        self, mode: Mode, *, armed: bool, arrived: bool, now: float
    ) -> Intervention | None:
        """React to a lost stream, a finished mission, and a completed return."""
        if self._has_landed(mode, armed=armed, arrived=arrived, now=now):
            return Intervention(self._intended, disarm=True, disarm_text="Disarmed by landing")
        if armed and self._mission_is_over(mode):
            self.choose(Mode.HOLD)
            return Intervention(Mode.HOLD)
        if not armed or self._intended is not Mode.GUIDED:
            self._failing = False
            return None
        was_failing, self._failing = self._failing, self._is_lost(now)
        if self._failing:
            return None if was_failing else self._answer_loss()
        return Intervention(Mode.GUIDED) if mode is not Mode.GUIDED else None

    def _mission_is_over(self, mode: Mode) -> bool:
        missions = self._parts.missions
        return mode is Mode.AUTO and (missions.complete or missions.item_count == 0)

    def position_lost(self) -> Intervention:
        """Land, the first action that needs no position: the rover stops and is disarmed."""
        self._say("Failsafe activated")
        self._intended = Mode.LAND  # so that it does not re-enter OFFBOARD by itself
        return Intervention(Mode.LAND)

    def fence_breached(self) -> Intervention:
        """Enter HOLD: GF_ACTION is 2."""
        self._say("Failsafe activated")
        self._intended = Mode.HOLD
        return Intervention(Mode.HOLD)

    def hear_heartbeat(self, system_id: int, *, now: float) -> None:
        """Ignore heartbeats: NAV_DLL_ACT is 0."""

    def take_local(self, message: Local, estimate: Estimate, *, mode: Mode, now: float) -> None:
        """Count a setpoint; in OFFBOARD follow it."""
        yaw_rate = self._parts.honours_yaw_rate
        self._take(read_px4_local(message, estimate, yaw_rate=yaw_rate), mode, now)

    def take_global(self, message: Global, estimate: Estimate, *, mode: Mode, now: float) -> None:
        """Count a setpoint; in OFFBOARD follow it."""
        del estimate
        self._take(read_px4_global(message, self._parts.origin), mode, now)

    def go_to(self, destination: Destination | None, *, now: float) -> None:
        """Drive to a place in HOLD; None: stay at the place of the next step."""
        del now
        self._place = destination
        if destination is None:
            self._held_at = None

    def change_speed(self, speed: float, mode: Mode) -> bool:
        """Set the speed until the mode changes; 0 or less resets it. Return False if not finite."""
        del mode
        if not math.isfinite(speed):
            return False
        self._cruise = speed if speed > 0.0 else None
        return True

    def follow_setpoints(self, estimate: Estimate, *, now: float) -> Demand:
        """Return the demand in OFFBOARD."""
        del now
        match self._offboard.target:
            case None:
                return STOP
            case Destination(north, east):
                limit = min(self._offboard.speed or self.cruise_speed, self.cruise_speed)
                place = Destination(north, east)
                return self._to(estimate, place, limit, self._acceptance_radius) or STOP
            case Heading(yaw, speed):
                return self._guidance.to_course(estimate, yaw, speed)
            case TurnRate(yaw_rate, speed):
                return Demand(speed, yaw_rate)

    def steer_to(self, estimate: Estimate, place: Destination, speed_limit: float) -> Demand | None:
        """Return the demand in AUTO and RTL; None on arrival."""
        return self._to(estimate, place, speed_limit, self._acceptance_radius)

    def hold(self, estimate: Estimate) -> Demand:
        """Return the demand to the place of DO_REPOSITION, or back to where HOLD began."""
        if self._held_at is None:
            self._held_at = Destination(estimate.north, estimate.east)
        place = self._place or self._held_at
        demand = self._to(estimate, place, self.cruise_speed, self._acceptance_radius)
        if demand is None and self._place is not None:
            self._held_at, self._place = self._place, None
        return demand or HOLD

    def mission_route(self, home: Destination) -> Route | None:
        """Return the stored mission from its current item, or None."""
        del home
        route = self._parts.missions.route()
        if route is not None:
            route.skip_to(self._parts.missions.current)
        return route

    def _can_run(self, mode: Mode, now: float) -> bool:
        if mode is Mode.GUIDED:
            return self._offboard.is_streaming(now=now)
        return mode is not Mode.AUTO or self._parts.missions.route() is not None

    def _take(self, reading: Setpoint | str, mode: Mode, now: float) -> None:
        if isinstance(reading, str):
            self._say(reading)
            return
        self._offboard.hear(now=now)
        if mode is Mode.GUIDED:
            self._offboard.follow(reading)

    def _say(self, text: str) -> None:
        self._parts.outbox.say(MavSeverity.CRITICAL, text)

    @property
    def _acceptance_radius(self) -> float:
        return self._parts.parameters["NAV_ACC_RAD"]

    def _to(
        self, estimate: Estimate, place: Destination, speed_limit: float, radius: float
    ) -> Demand | None:
        return self._guidance.to_place(estimate, *place, speed_limit, radius=radius)

    def _is_lost(self, now: float) -> bool:
        return self._offboard.silence(now=now) > self._parts.parameters["COM_OF_LOSS_T"]

    def _answer_loss(self) -> Intervention | None:
        values = self._parts.parameters
        action = action_on_loss(
            int(values["COM_OBL_RC_ACT"]), int(values["NAV_RCL_ACT"]), sticks=self.sticks_present
        )
        intervention = INTERVENTIONS[action]
        if intervention is not None:
            self._say("Failsafe activated")
        if intervention is not None and intervention.mode is Mode.RTL:
            self._tell_return()
        return intervention

    def _tell_return(self) -> None:
        height = round(self._parts.origin.altitude + RETURNS_OVER)
        self._parts.outbox.inform(DESTINATION_TEXT)
        self._parts.outbox.inform(
            f"RTL: start return at {height} m ({RETURNS_OVER:.0f} m above destination)"
        )

    def _has_landed(self, mode: Mode, *, armed: bool, arrived: bool, now: float) -> bool:
        return self._landing.watch(
            is_there=armed and (mode is Mode.LAND or (mode is Mode.RTL and arrived)),
            disarm_after=self._parts.parameters["COM_DISARM_LAND"],
            now=now,
        )
