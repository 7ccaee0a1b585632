"""Modes and arming: what decides, at each moment, who drives.

As observed on Rover 4.6.3: any mode may be entered disarmed, arming needs a settled estimate, and
a mode that drives by itself starts to when armed.
"""

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.enums import MavSeverity, MavState
from rover_sim.estimate import Estimate
from rover_sim.failsafe import OperatorFailsafe
from rover_sim.faults import NO_FAULTS, Faults
from rover_sim.guided import Guided
from rover_sim.mission_storage import MissionStorage
from rover_sim.outbox import Outbox
from rover_sim.parameters import Parameters
from rover_sim.personas import Mode, Persona
from rover_sim.route import Route, Waypoint, square_around
from rover_sim.setpoints import Destination
from rover_sim.steering import COAST, HOLD, STOP, Demand

INITIALISING_TIME = 0.25  # s after start, then MANUAL. The real one takes seconds; tests do not
SETTLING_TIME = 0.5  # s after start until the position estimate is good for arming


class FlightControl:
    """Mode, arming, and the demand that follows from them."""

    def __init__(
        self,
        *,
        persona: Persona,
        parameters: Parameters,
        guided: Guided,
        missions: MissionStorage,
        outbox: Outbox,
        home: Destination,
        now: float,
    ) -> None:
        self.guided = guided
        self.home = home
        self.faults: Faults = NO_FAULTS
        self.failsafe = OperatorFailsafe(parameters)
        self.mode = Mode.INITIALISING
        self.armed = False
        self.mission_complete = False
        self._persona = persona
        self._parameters = parameters
        self._missions = missions
        self._outbox = outbox
        self._started = now
        self._route: Route | None = None
        self._sticks = STOP
        self._announced = (self.mode, self.armed)

    def __repr__(self) -> str:
        return f"FlightControl({self.mode.name}, {'armed' if self.armed else 'disarmed'})"

    @property
    def custom_mode(self) -> int:
        """The mode's number, as HEARTBEAT has it."""
        return self._persona.modes[self.mode]

    @property
    def system_status(self) -> MavState:
        """MAV_STATE as Rover derives it: from failsafe and mode, not from arming."""
        if self.failsafe.tripped:
            return MavState.CRITICAL
        if self.mode is Mode.INITIALISING:
            return MavState.CALIBRATING
        return MavState.STANDBY if self.mode is Mode.HOLD else MavState.ACTIVE

    @property
    def destination(self) -> Destination | None:
        """Where it drives to, if it drives to a place."""
        if self.mode is Mode.GUIDED:
            return self.guided.destination
        if self._route is not None and self._route.next is not None:
            return self._route.next.place
        return None

    @property
    def current_item(self) -> int:
        """The mission item that AUTO is at, for MISSION_CURRENT."""
        waypoint = self._route.next if self._route is not None else None
        return waypoint.seq if self.mode is Mode.AUTO and waypoint is not None else 0

    def announce(self) -> bool:
        """Whether mode or arming changed since the last call."""
        seen, self._announced = self._announced, (self.mode, self.armed)
        return seen != self._announced

    def request_mode(self, custom_mode: int) -> bool:
        """Change the mode at a client's wish."""
        mode = self._persona.mode_of(custom_mode)
        if mode is None:
            self._outbox.say(MavSeverity.INFO, f"No such mode {custom_mode}")
            return False
        if self.faults.refuse_mode or Mode.INITIALISING in (mode, self.mode):
            self._outbox.say(MavSeverity.WARNING, "Flight mode change failed")
            return False
        self.enter(mode)
        return True

    def enter(self, mode: Mode) -> None:
        """Change the mode. Entering the present one again changes nothing, not even a target."""
        if mode is self.mode:
            return
        self.mode = mode
        self._route = None
        self._sticks = STOP
        if mode is Mode.GUIDED:
            self.guided.clear()
        elif mode is Mode.AUTO:
            self.mission_complete = False
            self._route = self._missions.route() or square_around(self.home)
        elif mode is Mode.RTL:
            self._route = Route((Waypoint(0, self.home),), loop=False)

    def skip_to_item(self, seq: int) -> None:
        """Go on with another mission item; only AUTO with a mission has any."""
        if self._route is not None and self._missions.item_count > 0:
            self._route.skip_to(seq)

    def arm(self, *, forced: bool, now: float) -> bool:
        """Arm at a client's wish; forcing skips the checks but not a fault."""
        if self.armed:
            return True
        if self.faults.refuse_arm:
            self._outbox.say(MavSeverity.CRITICAL, "Arm: refused by a simulated fault")
            return False
        if not forced and now - self._started < SETTLING_TIME:
            text = "Arm: AHRS: not using configured AHRS type"
            self._outbox.say(MavSeverity.CRITICAL, text)
            return False
        self.set_armed(True)
        return True

    def set_armed(self, armed: bool) -> None:
        """Arm or disarm, without checks. Disarming always works: the rover coasts."""
        if armed is not self.armed:
            self.armed = armed
            text = "Throttle armed" if armed else "Throttle disarmed"
            self._outbox.say(MavSeverity.INFO, text)

    def set_sticks(self, speed: float, yaw_rate: float) -> None:
        """Drive by hand; has an effect only in MANUAL."""
        self._sticks = Demand(speed, yaw_rate)

    def demand(self, estimate: Estimate, *, now: float) -> Demand:
        """Say how to move now. Called once per control step: it also lets time pass."""
        self._pass_time(now)
        match self.mode:
            case Mode.INITIALISING:
                return COAST
            case Mode.MANUAL:
                demand = self._sticks
            case Mode.HOLD:
                demand = HOLD
            case Mode.GUIDED:  # asked also while disarmed: its time-out goes on
                demand = self.guided.demand(estimate, now=now)
            case Mode.AUTO | Mode.RTL:
                demand = self._follow_route(estimate) if self.armed else STOP
        return demand if self.armed else COAST

    def _pass_time(self, now: float) -> None:
        if self.mode is Mode.INITIALISING and now - self._started >= INITIALISING_TIME:
            self.enter(Mode.MANUAL)
        if self.failsafe.changed(now=now):
            self._act_on_failsafe()

    def _act_on_failsafe(self) -> None:
        if not self.failsafe.tripped:
            self._outbox.say(MavSeverity.INFO, "GCS Failsafe Cleared")
            return
        # The real one says Radio: the RC check shares the failsafe bits.
        self._outbox.say(MavSeverity.WARNING, "Radio Failsafe")
        if self.armed:
            self.enter(Mode.HOLD)

    def _follow_route(self, estimate: Estimate) -> Demand:
        if self._route is None:
            return STOP
        demand, reached = self._route.demand(estimate, self._parameters["WP_SPEED"])
        if reached is not None and self.mode is Mode.AUTO and reached.seq > 0:
            self._outbox.send(messages.MissionItemReached(reached.seq))
            if self._route.next is None:
                self.mission_complete = True
                self._outbox.say(MavSeverity.INFO, "Mission Complete")
        return demand
