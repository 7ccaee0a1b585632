"""Setpoints and failsafes of a PX4 1.17 rover, including its surprises.

Recorded and tried on 1.17.0. It differs from PX4's guide, in ways that matter to a controller:

- A velocity is a speed and a course, atan2(east, north). Zero velocity is a course, too: north for
  plain zeros, or south if a zero is negative (0.0 * cos of a southerly heading). A differential
  rover turns to it on the spot, an Ackermann rover bends while it brakes.
- It never drives backwards: it turns round while it drives.
- When setpoints end, the tables ``offboard_loss`` and ``stick_loss`` of the persona apply after
  COM_OF_LOSS_T; by default the rover drives home.
- HOLD keeps the place where it began: a rover that rolled beyond NAV_ACC_RAD drives back to it.
- After a return it counts as landed, and disarms itself.
- While disarmed it accepts any mode; it is not armed in one that cannot run.

Not modelled: failsafes of data link, battery, fence and estimator; the 5 s of Hold before RTL
(COM_FAIL_ACT_T); loss of sticks, which are absent until a test holds them.

Texts fit into one STATUSTEXT and lack the tab at the end of the real ones (PX4 sends an EVENT
beside each, so that a ground station drops the text).
"""

import math

from mav_tasks.mavlink.enums import MavSeverity, MavState
from rover_sim.flight import Flight
from rover_sim.modes import Mode
from rover_sim.onboard import Onboard
from rover_sim.px4_guidance import Px4Guidance
from rover_sim.px4_setpoints import read_px4
from rover_sim.setpoints import Destination, Global, Heading, Local, TurnRate
from rover_sim.steering import HOLD, STOP, Demand

RETURNS_OVER = 60.0  # m, RTL_RETURN_ALT: only for the text, as no rover rises
LANDED_AFTER = 0.5  # s, of its land detector's hysteresis
STREAM_GAP = 0.5  # s, longest gap between two setpoints: PX4's guide asks for 2 Hz
NEEDS_STICKS = (Mode.POSITION.value, Mode.MANUAL.value)


class Px4Flight(Flight):
    """Counts setpoints in any mode; keeps the last one that came in OFFBOARD."""

    reposition_mode = Mode.HOLD

    def __init__(self, on: Onboard) -> None:
        super().__init__(on)
        self._failing = False
        self._setpoint_speed: float | None = None  # m/s towards a place, if the setpoint has one
        self._last_setpoint = float("-inf")
        self._gap = math.inf  # s between the last two setpoints
        self._cruise = math.inf  # m/s, from DO_CHANGE_SPEED
        self._guidance = Px4Guidance(on)
        self._held_at: Destination | None = None  # where HOLD began; None: set at the next step
        self._there_since: float | None = None  # at the end of a return, or in LAND
        self._has_landed = False

    @property
    def system_status(self) -> MavState:
        """MAV_STATE, from failsafe and arming, not from the mode."""
        if self._failing:
            return MavState.CRITICAL
        return MavState.ACTIVE if self.armed else MavState.STANDBY

    def choose(self, mode: Mode) -> None:
        """Note a requested mode: this ends a failsafe, even in the same mode."""
        super().choose(mode)
        self._failing = False

    def begin(self, mode: Mode) -> None:
        """Begin a mode; keep the last setpoint for a return to OFFBOARD.

        HOLD keeps the rover's place at its first step.
        """
        del mode
        self.hold_destination = self._held_at = None
        self._cruise = math.inf

    def can_run(self, mode: Mode) -> bool:
        """Return whether setpoints stream (two or more, the last one recently), or a mission is."""
        if mode is Mode.GUIDED:
            return self._gap <= STREAM_GAP and self.on.now - self._last_setpoint <= STREAM_GAP
        return mode is not Mode.AUTO or self.on.missions.route() is not None

    def watch(self, *, arrived: bool) -> None:
        """React to a lost stream, a finished mission, and a completed return."""
        if self._disarms_landed(arrived):
            self._switch(self.intended)
            self.set_armed(False, text="Disarmed by landing")
            return
        missions = self.on.missions
        if self.armed and self.mode is Mode.AUTO and (missions.complete or not missions.item_count):
            self.enter(Mode.HOLD)
            return
        if not self.armed or self.intended is not Mode.GUIDED:
            self._failing = False
            return
        silence = self.on.now - self._last_setpoint
        was_failing, self._failing = self._failing, silence > self.on.parameters["COM_OF_LOSS_T"]
        if not self._failing:
            self._switch(Mode.GUIDED)
        elif not was_failing:
            self._answer_loss()

    def _disarms_landed(self, arrived: bool) -> bool:
        """Watch for the landing of an armed rover; return whether it is time to disarm."""
        now, wait = self.on.now, self.on.parameters["COM_DISARM_LAND"]  # s; 0 or less: never
        if not self.armed or not (self.mode is Mode.LAND or (self.mode is Mode.RTL and arrived)):
            self._there_since, self._has_landed = None, False
            return False
        if self._there_since is None:
            self._there_since = now
        stood = now - self._there_since
        if not self._has_landed and stood >= LANDED_AFTER:
            self._has_landed = True
            self.on.outbox.inform("Landing detected")
        return wait > 0.0 and stood >= LANDED_AFTER + wait

    def _answer_loss(self) -> None:
        values, persona = self.on.parameters, self.on.persona
        action = persona.offboard_loss.get(int(values["COM_OBL_RC_ACT"]), Mode.POSITION.value)
        if action in NEEDS_STICKS and not self.on.sticks.is_there:
            action = persona.stick_loss.get(int(values["NAV_RCL_ACT"]), "")
        if not action:
            return
        self.on.outbox.say(MavSeverity.CRITICAL, "Failsafe activated")
        if action == "disarm":
            self.set_armed(False)
            return
        if action == Mode.RTL.value:
            height = round(self.on.origin.altitude + RETURNS_OVER)
            above = f"({RETURNS_OVER:.0f} m above destination)"
            self.on.outbox.inform("RTL: land at destination")
            self.on.outbox.inform(f"RTL: start return at {height} m {above}")
        self._switch(Mode(action))

    def take(self, message: Local | Global) -> None:
        """Count a setpoint; in OFFBOARD follow it."""
        on = self.on
        reading = read_px4(message, on.estimate, on.origin, yaw_rate=on.persona.honours_yaw_rate)
        if isinstance(reading, str):
            self.on.outbox.say(MavSeverity.CRITICAL, reading)
            return
        self._gap, self._last_setpoint = on.now - self._last_setpoint, on.now
        if self.mode is Mode.GUIDED:
            self.setpoint, self._setpoint_speed = reading

    def go_to(self, place: Destination | None) -> None:
        """Drive to a place in HOLD; None: stay at the place of the next step."""
        self.hold_destination = place
        if place is None:
            self._held_at = None

    def change_speed(self, speed: float) -> bool:
        """Set the speed until the mode changes; 0 or less resets it. Return False if not finite."""
        if not math.isfinite(speed):
            return False
        self._cruise = speed if speed > 0.0 else math.inf
        return True

    def follow_setpoint(self) -> Demand:
        """Return the demand in OFFBOARD."""
        match self.setpoint:
            case None:
                return STOP
            case Destination() as place:
                return self.steer_to(place, self._setpoint_speed or math.inf) or STOP
            case Heading(yaw, speed):
                return self._guidance.to_course(yaw, speed)
            case TurnRate(yaw_rate, speed):
                return Demand(speed, yaw_rate)

    def hold(self) -> Demand:
        """Return the demand to the place of DO_REPOSITION, or back to where HOLD began."""
        if self._held_at is None:
            self._held_at = self._here
        demand = self.steer_to(self.hold_destination or self._held_at)
        if demand is None and self.hold_destination is not None:
            self._held_at, self.hold_destination = self.hold_destination, None
        return demand or HOLD

    def steer_to(self, place: Destination, most: float = math.inf) -> Demand | None:
        """Return the demand towards a place, by default as in AUTO and RTL; None on arrival."""
        speed = min(most, self._cruise, self.on.speed_limit)
        return self._guidance.to_place(place, speed, radius=self.on.parameters["NAV_ACC_RAD"])
