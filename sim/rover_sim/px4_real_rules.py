"""The rules of the real PX4 1.17 rover, including its surprises.

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
"""

from rover_sim.estimate import Estimate
from rover_sim.flight_rules import FlightParts, FlightRules, Intervention
from rover_sim.modes import Mode
from rover_sim.px4_failsafe import INTERVENTIONS, action_on_loss
from rover_sim.px4_guidance import Px4Guidance
from rover_sim.px4_landing import Landing
from rover_sim.px4_rules import Px4Rules
from rover_sim.realism import Drive
from rover_sim.setpoints import Destination, Heading, TurnRate
from rover_sim.steering import HOLD, STOP, Demand

RETURNS_OVER = 60.0  # m, RTL_RETURN_ALT: only for the text, as no rover rises
DESTINATION_TEXT = "RTL: land at destination"


def px4_rules(parts: FlightParts) -> FlightRules:
    """Return the rules for an exact or a real drive."""
    return Px4Rules(parts) if parts.drive is Drive.EXACT else RealPx4Rules(parts)


class RealPx4Rules(Px4Rules):
    """The real PX4 rover where it differs from ``Px4Rules``; implements ``FlightRules``."""

    def __init__(self, parts: FlightParts) -> None:
        super().__init__(parts)
        self._guidance = Px4Guidance(parts.frame, parts.parameters)
        self._landing = Landing(parts.outbox)
        self._held_at: Destination | None = None  # where HOLD began; None: set at the next step

    def mode_refusal(self, wanted: Mode, present: Mode, *, armed: bool, now: float) -> str | None:
        """Return a refusal for a mode that cannot run now, if it is armed."""
        refusal = super().mode_refusal(wanted, present, armed=armed, now=now)
        return refusal if armed else None

    def enter(self, mode: Mode) -> None:
        """Begin a mode; HOLD keeps the rover's place at its first step."""
        super().enter(mode)
        self._held_at = None

    def go_to(self, destination: Destination | None, *, now: float) -> None:
        """Drive to a place in HOLD; None: stay at the place of the next step."""
        super().go_to(destination, now=now)
        if destination is None:
            self._held_at = None

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

    def hold(self, estimate: Estimate) -> Demand:
        """Return the demand to the place of DO_REPOSITION, or back to where HOLD began."""
        if self._held_at is None:
            self._held_at = Destination(estimate.north, estimate.east)
        place = self._place or self._held_at
        demand = self._to(estimate, place, self.cruise_speed, self._acceptance_radius)
        if demand is None and self._place is not None:
            self._held_at, self._place = self._place, None
        return demand or HOLD

    def steer_to(self, estimate: Estimate, place: Destination, speed_limit: float) -> Demand | None:
        """Return the demand in AUTO and RTL; None on arrival."""
        return self._to(estimate, place, speed_limit, self._acceptance_radius)

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
