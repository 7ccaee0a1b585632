"""Modes, arming and offboard-loss failsafe of a PX4 rover, idealised.

For tests of exact arithmetic; ``px4_real_rules`` has the real behaviour.

Modelled: the conditions for entering a mode and arming in it (OFFBOARD needs a stream, MISSION a
mission), the loss of the stream (COM_OF_LOSS_T, COM_OBL_RC_ACT) and its return, places for HOLD
(DO_REPOSITION). Stricter than the real one, which accepts any mode while disarmed, and refuses to
arm in it instead. Not modelled: failsafes of data link, battery, fence and estimator; the 5 s of
Hold before RTL (COM_FAIL_ACT_T); AUTO.LAND; replacing a mission while driving it (the real one
drives the new one); loss of sticks, which are absent until a test holds them.

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
from rover_sim.px4_setpoints import Setpoint, read_px4_global, read_px4_local
from rover_sim.route import Route
from rover_sim.setpoints import Destination, Global, Local, Target
from rover_sim.steering import HOLD, Demand, steer_to_point

ARRIVAL_RADIUS = 0.3  # m

NAMES: Mapping[Mode, str] = {
    Mode.MANUAL: "Manual",
    Mode.POSITION: "Position",
    Mode.HOLD: "Hold",
    Mode.AUTO: "Mission",
    Mode.RTL: "Return",
    Mode.LAND: "Land",
    Mode.GUIDED: "Offboard",
}

# COM_OBL_RC_ACT, 1.15. The modes of 0 to 2 (position, altitude, manual) need sticks; without them
# the real one falls back to a mode that needs none, here HOLD. A landing rover (4) stands.
LOST: Mapping[int, Intervention] = {
    3: Intervention(Mode.RTL),
    6: Intervention(disarm=True),  # terminate: the real one also stays locked until it restarts
    7: Intervention(disarm=True),
}
LOST_OTHERWISE = Intervention(Mode.HOLD)


class Px4Rules:
    """The idealised PX4 rules; implements ``FlightRules``."""

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
        """Return a refusal for a mode that cannot run now, else None."""
        del present, armed
        if self._can_run(wanted, now):
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
        """Begin a mode; keep the last setpoint for a return to OFFBOARD."""
        del mode
        self._place = self._cruise = None

    def intervene(
        self, mode: Mode, *, armed: bool, arrived: bool, now: float
    ) -> Intervention | None:
        """Leave OFFBOARD when the stream is lost, and MISSION at its end.

        When the stream returns, the rover re-enters OFFBOARD and drives on: the failsafe lasts only
        as long as its cause.
        """
        del arrived
        if armed and self._mission_is_over(mode):
            self.choose(Mode.HOLD)
            return Intervention(Mode.HOLD)
        if not armed or self._intended is not Mode.GUIDED:
            self._failing = False
            return None
        lost = self._offboard.silence(now=now) > self._parts.parameters["COM_OF_LOSS_T"]
        self._failing = lost
        if lost and mode is Mode.GUIDED:
            action = LOST.get(int(self._parts.parameters["COM_OBL_RC_ACT"]), LOST_OTHERWISE)
            what = "disarming" if action.mode is None else f"entering {NAMES[action.mode]}"
            self._say(f"Failsafe: no offboard signal, {what}")
            return action
        if not lost and mode is not Mode.GUIDED:
            self._say("Failsafe cleared: back to Offboard")
            return Intervention(Mode.GUIDED)
        return None

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
        """Drive to a place in HOLD; None: stay here."""
        del now
        self._place = destination

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
        return self._offboard.demand(estimate, self._parts.speed_limit())

    def steer_to(self, estimate: Estimate, place: Destination, speed_limit: float) -> Demand | None:
        """Return the demand in AUTO and RTL; None on arrival."""
        return steer_to_point(estimate, *place, speed_limit, radius=ARRIVAL_RADIUS)

    def hold(self, estimate: Estimate) -> Demand:
        """Return the demand to the place of DO_REPOSITION; without a place, stop."""
        if self._place is None:
            return HOLD
        speed, radius = self.cruise_speed, ARRIVAL_RADIUS
        demand = steer_to_point(estimate, *self._place, speed, radius=radius)
        if demand is None:
            self._place = None
            return HOLD
        return demand

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
