"""Modes and arming: decides at each moment what drives the rover.

This file has what all makes share; the persona's ``FlightRules`` have what differs.
"""

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.enums import MavSeverity, MavState
from rover_sim.boot import Boot
from rover_sim.estimate import Estimate
from rover_sim.faults import NO_FAULTS, Faults
from rover_sim.flight_rules import FlightRules, Intervention
from rover_sim.home import Follower
from rover_sim.mission_storage import MissionStorage
from rover_sim.modes import Mode, ModeNumbers
from rover_sim.outbox import Outbox
from rover_sim.realism import Change
from rover_sim.route import Route, Waypoint
from rover_sim.setpoints import Destination, Global, Heading, Local, Target, TurnRate
from rover_sim.steering import COAST, STOP, Demand
from rover_sim.sticks import Sticks

NEEDS_POSITION = (Mode.GUIDED, Mode.AUTO, Mode.RTL)


class FlightControl:
    """Mode, arming, and the resulting demand."""

    def __init__(
        self,
        *,
        modes: ModeNumbers,
        rules: FlightRules,
        missions: MissionStorage,
        outbox: Outbox,
        home: Destination,
        boot: Boot,
        sticks: Sticks,
        follower: Follower,
    ) -> None:
        self.home = home
        self.faults: Faults = NO_FAULTS
        self.mode = modes.first
        self.armed = False
        self._modes = modes
        self._rules = rules
        self._missions = missions
        self._missions.complete = False
        self._outbox = outbox
        self._boot = boot
        self._radio = sticks
        self._follower = follower
        self._route: Route | None = None
        self._sticks = STOP
        self._here = home  # the present position
        self._announced = (self.mode, self.armed)

    def __repr__(self) -> str:
        return f"FlightControl({self.mode.name}, {'armed' if self.armed else 'disarmed'})"

    @property
    def custom_mode(self) -> int:
        """The mode's number, as in HEARTBEAT."""
        return self._modes.numbers[self.mode]

    @property
    def intended_custom_mode(self) -> int:
        """The number of the last requested mode, as in CURRENT_MODE."""
        return self._modes.numbers[self._rules.intended(self.mode)]

    @property
    def system_status(self) -> MavState:
        """MAV_STATE, as in HEARTBEAT."""
        return self._rules.system_status(self.mode, armed=self.armed)

    @property
    def target(self) -> Target | None:
        """The target of the setpoints while they are followed, else None."""
        return self._rules.target if self.mode is Mode.GUIDED else None

    @property
    def destination(self) -> Destination | None:
        """The place that the rover drives to, or None."""
        if self.mode is Mode.GUIDED:
            return self.target if isinstance(self.target, Destination) else None
        if self.mode is Mode.HOLD:
            return self._rules.hold_destination
        if self._route is not None and self._route.next is not None:
            return self._route.next.place
        return None

    @property
    def current_item(self) -> int:
        """The current mission item, for MISSION_CURRENT."""
        waypoint = self._route.next if self._route is not None else None
        if self.mode is Mode.AUTO and waypoint is not None and waypoint.seq is not None:
            return waypoint.seq
        return self._missions.current

    def take_changes(self) -> Change:
        """Return the changes since the last call."""
        mode, armed = self._announced
        self._announced = (self.mode, self.armed)
        changed = Change.NOTHING if mode is self.mode else Change.MODE
        return changed if armed is self.armed else changed | Change.ARMING

    def request_mode(self, mode: Mode, *, now: float) -> bool:
        """Change the mode for a client; return False if refused."""
        refusal = None
        if self.mode is not Mode.INITIALISING or not self._boot.takes_modes(now=now):
            refusal = self._rules.mode_refusal(mode, self.mode, armed=self.armed, now=now)
        if self.faults.refuse_mode:
            refusal = "Flight mode change failed"
        if refusal is not None:
            self._outbox.say(MavSeverity.WARNING, refusal)
            return False
        self.enter(mode)
        return True

    def request_custom_mode(self, custom_mode: int, *, now: float) -> bool:
        """Change the mode for a client, by its number; return False if refused."""
        mode = self._modes.mode_of(custom_mode)
        if mode is None:
            self._outbox.say(MavSeverity.INFO, self._rules.unknown_mode(custom_mode))
            return False
        return self.request_mode(mode, now=now)

    def enter(self, mode: Mode) -> None:
        """Change the mode, without checks."""
        self._rules.choose(mode)
        self._switch(mode)

    def skip_to_item(self, seq: int) -> bool:
        """Continue with another mission item, now or on the next AUTO; return False if refused."""
        if not self._missions.move_to(seq):
            return False
        if self.mode is Mode.AUTO and self._route is not None and self._missions.item_count > 0:
            self._route.skip_to(seq)
        return True

    def reposition(
        self, destination: Destination | None, *, keeps_place: bool = False, now: float
    ) -> bool:
        """Drive to a place (None: stay) in the reposition mode; return False if refused.

        ``keeps_place``: drive on to the previous place, if there is one.
        """
        mode = self._rules.reposition_mode
        if self.mode is not mode and not self.request_mode(mode, now=now):
            return False
        self._rules.choose(mode)
        if not keeps_place:
            self._rules.go_to(destination, now=now)
        return True

    @property
    def can_reposition(self) -> bool:
        """Whether the rover is in the mode in which it drives to a place."""
        return self.mode is self._rules.reposition_mode

    def change_speed(self, speed: float) -> bool:
        """Change the speed of the modes that drive by themselves; return False if refused."""
        return self._rules.change_speed(speed, self.mode)

    def arm(self, *, forced: bool, now: float) -> bool:
        """Arm for a client; return success. ``forced`` skips the make's checks, not faults."""
        if self.armed:
            return True
        if self.faults.refuse_arm:
            self._outbox.say(MavSeverity.CRITICAL, "Arm: refused by a simulated fault")
            return False
        not_ready = () if forced else self._boot.arming_refusal(now=now)
        for text in not_ready:
            self._outbox.say(MavSeverity.CRITICAL, text)
        if not_ready:
            return False
        if self.faults.gps_lost:
            self._outbox.say(MavSeverity.CRITICAL, self._rules.no_position_text)
            return False
        refusal = self._rules.arming_refusal(self.mode, forced=forced, now=now)
        if refusal is None and not forced:
            refusal = self._radio.arming_refusal(now=now)
        if refusal is not None:
            self._outbox.say(MavSeverity.CRITICAL, refusal)
            return False
        self.set_armed(True)
        return True

    def set_armed(self, armed: bool, *, text: str | None = None) -> None:
        """Arm or disarm, without checks. A disarmed rover coasts."""
        if armed is not self.armed:
            self.armed = armed
            if armed and self._follower.follows_arming:
                self.home = self._here
            self._rules.choose(self.mode)
            self._outbox.say(MavSeverity.INFO, text or self._rules.arming_text(armed=armed))

    def set_home(self, place: Destination | None) -> None:
        """Set home to a place; None sets it to the rover's position."""
        self._follower.name(here=place is None)
        self.home = place or self._here

    def set_sticks(self, speed: float, yaw_rate: float) -> None:
        """Drive manually; has an effect only in MANUAL and POSITION."""
        self._sticks = Demand(speed, yaw_rate)
        self._rules.sticks_present = True

    def hear_heartbeat(self, system_id: int, *, now: float) -> None:
        """Note a heartbeat from any system."""
        self._rules.hear_heartbeat(system_id, now=now)

    def lose_position(self) -> None:
        """Note the loss of the position; the rules end a mode that needs one."""
        if self.armed and self.mode in NEEDS_POSITION:
            self._intervene(self._rules.position_lost())

    def leave_fence(self) -> None:
        """Note that the rover left its own fence."""
        if self.armed:
            self._intervene(self._rules.fence_breached())

    def take_local(self, message: Local, estimate: Estimate, *, now: float) -> None:
        """Take SET_POSITION_TARGET_LOCAL_NED."""
        self._rules.take_local(message, estimate, mode=self.mode, now=now)

    def take_global(self, message: Global, estimate: Estimate, *, now: float) -> None:
        """Take SET_POSITION_TARGET_GLOBAL_INT."""
        self._rules.take_global(message, estimate, mode=self.mode, now=now)

    def demand(self, estimate: Estimate, *, now: float) -> Demand:
        """Return the demand. Call once per control step: it also advances time-outs."""
        self._pass_time(now)
        self._here = Destination(estimate.north, estimate.east)
        if not self.armed:
            self.home = self._follower.moved(self.home, estimate, now=now)
        match self.mode:
            case Mode.INITIALISING:
                return COAST
            case Mode.MANUAL | Mode.POSITION:
                demand = self._radio.demand(now=now) or self._sticks
            case Mode.HOLD | Mode.LAND:
                demand = self._rules.hold(estimate)
            case Mode.GUIDED:  # called also while disarmed, so that its time-out runs
                demand = self._rules.follow_setpoints(estimate, now=now)
                if isinstance(self.target, Heading | TurnRate):
                    demand = self._radio.nudged(demand, now=now)
            case Mode.AUTO | Mode.RTL:
                demand = self._follow_route(estimate) if self.armed else STOP
        return demand if self.armed else COAST

    def _switch(self, mode: Mode) -> None:
        """Switch the mode; re-entering the present mode changes nothing, not even a target."""
        if mode is self.mode:
            return
        self.mode = mode
        self._route = None
        self._sticks = STOP
        self._rules.enter(mode)
        if mode is Mode.AUTO:
            if self._missions.complete:
                self._missions.move_to(0)
            self._missions.complete = False
            self._route = self._rules.mission_route(self.home)
        elif mode is Mode.RTL:
            self._route = Route((Waypoint(None, self.home),), loop=False)

    def _pass_time(self, now: float) -> None:
        self._rules.sticks_present = self._rules.sticks_present or self._radio.is_there
        for text in self._boot.texts_due(now=now):
            self._outbox.inform(text)
        started = self.mode is Mode.INITIALISING and self._boot.is_initialised(now=now)
        if self._boot.loses_mode(now=now) or started:
            self.enter(Mode.MANUAL)
        arrived = self._route is not None and self._route.next is None
        intervention = self._rules.intervene(self.mode, armed=self.armed, arrived=arrived, now=now)
        self._intervene(intervention)

    def _intervene(self, intervention: Intervention | None) -> None:
        if intervention is None:
            return
        if intervention.mode is not None:
            self._switch(intervention.mode)
        if intervention.disarm:
            self.set_armed(False, text=intervention.disarm_text)

    def _follow_route(self, estimate: Estimate) -> Demand:
        if self._route is None:
            return STOP
        steer, cruise_speed = self._rules.steer_to, self._rules.cruise_speed
        demand, reached = self._route.demand(estimate, cruise_speed, steer)
        if reached is not None and reached.seq is not None:
            self._outbox.send(messages.MissionItemReached(reached.seq))
            following = self._route.next
            if following is None:
                self._missions.complete = True
                self._outbox.say(MavSeverity.INFO, "Mission Complete")
            elif following.seq is not None:
                self._missions.move_to(following.seq)
        return demand
