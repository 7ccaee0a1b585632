"""Modes and arming: decides at each moment what drives the rover.

``Flight`` has what all makes share; ``ardupilot_flight`` and ``px4_flight`` have how they follow
setpoints and when they intervene. Texts and tables are in the persona.
"""

import math

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.enums import MavSeverity, MavState
from rover_sim.modes import Mode
from rover_sim.onboard import Onboard
from rover_sim.route import Route, Waypoint, square_around
from rover_sim.setpoints import Destination, Global, Heading, Local, Target, TurnRate
from rover_sim.steering import COAST, STOP, Demand

NEEDS_POSITION = (Mode.GUIDED, Mode.AUTO, Mode.RTL)
LOOK = 1.0  # s between checks of home; ArduPilot's one_second_loop. PX4 checks in every loop


class Flight:
    """Mode, arming, and the resulting demand."""

    reposition_mode: Mode  # for the place of DO_REPOSITION
    hold_destination: Destination | None = None  # where HOLD drives to

    def __init__(self, on: Onboard) -> None:
        self.on = on
        self._persona = on.persona
        self._texts = on.persona.texts
        self.mode = self.intended = on.persona.modes.first
        self.armed = False
        self.setpoint: Target | None = None  # the last one in GUIDED
        self._here = self.home = Destination(on.estimate.north, on.estimate.east)
        self._home_is_set = False  # by a person
        self._home_looked_at = float("-inf")
        on.missions.complete = False
        self._route: Route | None = None

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.mode.name}, {'armed' if self.armed else 'disarmed'})"

    @property
    def destination(self) -> Destination | None:
        """The place that the rover drives to, or None."""
        if self.mode is Mode.GUIDED:
            return self.setpoint if isinstance(self.setpoint, Destination) else None
        if self.mode is Mode.HOLD:
            return self.hold_destination
        waypoint = self._waypoint
        return None if waypoint is None else waypoint.place

    @property
    def current_item(self) -> int:
        """The current mission item, for MISSION_CURRENT."""
        waypoint = self._waypoint
        if self.mode is Mode.AUTO and waypoint is not None and waypoint.seq is not None:
            return waypoint.seq
        return self.on.missions.current

    @property
    def _waypoint(self) -> Waypoint | None:
        return self._route.next if self._route is not None else None

    # requests of clients

    def request_mode(self, mode: Mode) -> bool:
        """Change the mode for a client; return False if refused."""
        refusal = None
        starts = Mode.INITIALISING in (mode, self.mode)
        if self.mode is Mode.INITIALISING and self.on.boot.takes_modes(self.on.now):
            starts = False
        if self.on.outbox.faults.refuse_mode or starts:
            refusal = "Flight mode change failed"
        elif self.armed and not self.can_run(mode):
            refusal = self._named("cannot_switch", mode)
        if refusal is not None:
            self.on.outbox.say(MavSeverity.WARNING, refusal)
            return False
        self.enter(mode)
        return True

    def request_custom_mode(self, custom_mode: int) -> bool:
        """Change the mode for a client, by its number; return False if refused."""
        mode = self._persona.modes.mode_of(custom_mode)
        if mode is None:
            self.on.outbox.inform(self._texts["no_such_mode"].format(custom_mode))
            return False
        return self.request_mode(mode)

    def reposition(self, place: Destination | None, *, keeps_place: bool = False) -> bool:
        """Drive to a place (None: stay) in the reposition mode; return False if refused.

        ``keeps_place``: drive on to the previous place, if there is one.
        """
        if not self.can_reposition and not self.request_mode(self.reposition_mode):
            return False
        self.choose(self.reposition_mode)
        if not keeps_place:
            self.go_to(place)
        return True

    @property
    def can_reposition(self) -> bool:
        """Whether the rover is in the mode in which it drives to a place."""
        return self.mode is self.reposition_mode

    def arm(self, *, forced: bool) -> bool:
        """Arm for a client; return success. ``forced`` skips the make's checks, not faults."""
        if self.armed:
            return True
        refusals = self._arming_refusals(forced)
        for text in refusals:
            self.on.outbox.say(MavSeverity.CRITICAL, text)
        if not refusals:
            self.set_armed(True)
        return not refusals

    def _arming_refusals(self, forced: bool) -> tuple[str, ...]:
        on, times = self.on, self.on.realism.boot
        if on.outbox.faults.refuse_arm:
            return ("Arm: refused by a simulated fault",)
        if not forced and (refusals := on.boot.arming_refusal(on.now)):
            return refusals
        if on.outbox.faults.gps_lost:
            return (self._texts["no_position"],)
        if not forced and times.is_none and on.now - on.started < times.armable:
            return (self._texts["settling"],)
        if not self.can_run(self.mode):
            return (self._named("cannot_run", self.mode),)
        refusal = None if forced else on.sticks.arming_refusal()
        return () if refusal is None else (refusal,)

    def _named(self, text: str, mode: Mode) -> str:
        return self._texts[text].format(self._texts[mode.value])

    def skip_to_item(self, seq: int) -> bool:
        """Continue with another mission item, now or on the next AUTO; return False if refused."""
        if not self.on.missions.move_to(seq):
            return False
        if self.mode is Mode.AUTO and self._route is not None and self.on.missions.item_count > 0:
            self._route.skip_to(seq)
        return True

    def set_home(self, place: Destination | None) -> None:
        """Set home to a place; None sets it to the rover's position."""
        self._home_is_set = self._persona.home.here_is_kept or place is not None
        self.home = place or self._here

    # changes without checks

    def enter(self, mode: Mode) -> None:
        """Change the mode, without checks."""
        self.choose(mode)
        self._switch(mode)

    def set_armed(self, armed: bool, *, text: str = "") -> None:
        """Arm or disarm, without checks. A disarmed rover coasts."""
        if armed is not self.armed:
            self.armed = armed
            if armed and self._persona.home.where_armed and not self._home_is_set:
                self.home = self._here
            self.choose(self.mode)
            self.on.outbox.inform(text or self._texts["armed" if armed else "disarmed"])

    def lose_position(self) -> None:
        """End a mode that needs a position."""
        if self.armed and self.mode in NEEDS_POSITION:
            self._fail_to(self._persona.position_lost, self._texts["position_lost"])

    def leave_fence(self) -> None:
        """Note that the rover left its own fence."""
        if self.armed:
            self._fail_to(Mode.HOLD, self._texts["fence_breached"])

    def _fail_to(self, mode: Mode, text: str) -> None:
        self.on.outbox.say(MavSeverity.CRITICAL, text)
        self.intended = mode  # so that PX4 does not re-enter OFFBOARD by itself
        self._switch(mode)

    def _switch(self, mode: Mode) -> None:
        """Switch the mode; re-entering the present mode changes nothing, not even a target."""
        if mode is self.mode:
            return
        self.mode = mode
        self._route = None
        self.begin(mode)
        missions = self.on.missions
        if mode is Mode.AUTO:
            if missions.complete:
                missions.move_to(0)
            missions.complete = False
            self._route = missions.route()
            if self._route is not None:
                self._route.skip_to(missions.current)
            elif self._persona.drives_square:
                self._route = square_around(self.home)
        elif mode is Mode.RTL:
            self._route = Route((Waypoint(None, self.home),))

    # each control step

    def demand(self) -> Demand:
        """Return the demand. Call once per control step: it also advances time-outs."""
        on, estimate = self.on, self.on.estimate
        self._pass_time()
        self._here = Destination(estimate.north, estimate.east)
        if not self.armed:
            self._move_home()
        match self.mode:
            case Mode.INITIALISING:
                return COAST
            case Mode.MANUAL | Mode.POSITION:
                demand = on.sticks.demand()
            case Mode.HOLD | Mode.LAND:
                demand = self.hold()
            case Mode.GUIDED:  # called also while disarmed, so that its time-out runs
                demand = self.follow_setpoint()
                if isinstance(self.setpoint, Heading | TurnRate):
                    demand = on.sticks.nudged(demand)
            case Mode.AUTO | Mode.RTL:
                demand = self._follow_route() if self.armed else STOP
        return demand if self.armed else COAST

    def _pass_time(self) -> None:
        on = self.on
        for text in on.boot.texts_due(on.now):
            on.outbox.inform(text)
        started = self.mode is Mode.INITIALISING and on.boot.is_initialised(on.now)
        if on.boot.loses_mode(on.now) or started:
            self.enter(Mode.MANUAL)
        self.watch(arrived=self._route is not None and self._route.next is None)

    def _move_home(self) -> None:
        """Let home follow a disarmed rover, until a person has set it."""
        if self._home_is_set or self.on.now - self._home_looked_at < LOOK:
            return
        self._home_looked_at = self.on.now
        here, home = self._here, self.home
        distance = math.hypot(here.north - home.north, here.east - home.east)
        if distance >= self._persona.home.least_move:
            self.home = here

    def _follow_route(self) -> Demand:
        route, waypoint, missions = self._route, self._waypoint, self.on.missions
        if route is None or waypoint is None:
            return STOP
        demand = self.steer_to(waypoint.place)
        if demand is not None:
            return demand
        route.advance()
        if waypoint.seq is not None:
            self.on.outbox.send(messages.MissionItemReached(waypoint.seq))
            if route.next is None:
                missions.complete = True
                self.on.outbox.inform("Mission Complete")
            elif route.next.seq is not None:
                missions.move_to(route.next.seq)
        return STOP

    # what each make does in its own way

    def choose(self, mode: Mode) -> None:
        """Note a requested mode, even if it is the present one."""
        self.intended = mode

    def can_run(self, mode: Mode) -> bool:
        """Return whether a mode can be entered armed, or the rover armed in it."""
        del mode
        return True

    def hear_heartbeat(self, system_id: int) -> None:
        """Note a heartbeat from any system."""

    @property
    def system_status(self) -> MavState:
        """MAV_STATE, as in HEARTBEAT."""
        raise NotImplementedError

    def begin(self, mode: Mode) -> None:
        """Begin a mode, no matter who requested it."""
        raise NotImplementedError

    def watch(self, *, arrived: bool) -> None:
        """Check the time-outs; ``arrived``: AUTO or RTL has reached the end of its route."""
        raise NotImplementedError

    def take(self, message: Local | Global) -> None:
        """Take a setpoint, in any mode."""
        raise NotImplementedError

    def go_to(self, place: Destination | None) -> None:
        """Take the place of DO_REPOSITION, in ``reposition_mode``; None: stay here."""
        raise NotImplementedError

    def change_speed(self, speed: float) -> bool:
        """Take DO_CHANGE_SPEED, m/s; return False if refused."""
        raise NotImplementedError

    def follow_setpoint(self) -> Demand:
        """Return the demand in GUIDED."""
        raise NotImplementedError

    def steer_to(self, place: Destination) -> Demand | None:
        """Return the demand in AUTO and RTL; None on arrival."""
        raise NotImplementedError

    def hold(self) -> Demand:
        """Return the demand in HOLD."""
        raise NotImplementedError
