"""The decisions that differ between flight stacks: the protocol behind ``flight``.

``flight`` does what all makes share; it asks the rules of its persona for the rest.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from mav_tasks.mavlink.enums import MavState
from rover_sim.estimate import Estimate
from rover_sim.frames import Frame
from rover_sim.geo import Origin
from rover_sim.mission_storage import MissionStorage
from rover_sim.modes import Mode
from rover_sim.outbox import Outbox
from rover_sim.parameters import Parameters
from rover_sim.route import Route
from rover_sim.setpoints import Destination, Global, Local, Target
from rover_sim.steering import Demand


@dataclass(frozen=True, slots=True)
class FlightParts:
    """The parts that rules are constructed from."""

    origin: Origin
    parameters: Parameters
    missions: MissionStorage
    outbox: Outbox
    speed_limit: Callable[[], float]  # m/s
    honours_yaw_rate: bool
    started: float  # s
    frame: Frame
    settling_time: float  # s until it can be armed; 0 if a simulated boot decides that


class Intervention(NamedTuple):
    """An action that a flight stack takes by itself."""

    mode: Mode | None = None
    disarm: bool = False
    disarm_text: str | None = None  # None: the text for a command


class FlightRules(Protocol):
    """Modes, arming, setpoints and failsafes of one make."""

    reposition_mode: Mode  # for the place of DO_REPOSITION
    sticks_present: bool  # a person holds the sticks of the RC transmitter
    no_position_text: str  # refuses arming without GPS

    @property
    def target(self) -> Target | None:
        """The target of the setpoints, in GUIDED."""
        ...

    @property
    def hold_destination(self) -> Destination | None:
        """The place that the rover drives to in HOLD, or None."""
        ...

    def system_status(self, mode: Mode, *, armed: bool) -> MavState:
        """Return MAV_STATE."""
        ...

    def arming_text(self, *, armed: bool) -> str:
        """Return the text that reports arming or disarming."""
        ...

    def unknown_mode(self, custom_mode: int) -> str:
        """Return the text for a mode number that does not exist."""
        ...

    def mode_refusal(self, wanted: Mode, present: Mode, *, armed: bool, now: float) -> str | None:
        """Return the text that refuses a client's mode change; None allows it."""
        ...

    def arming_refusal(self, mode: Mode, *, forced: bool, now: float) -> str | None:
        """Return the text that refuses arming; None allows it."""
        ...

    def intended(self, mode: Mode) -> Mode:
        """Return the mode that was requested last, which a failsafe does not change."""
        ...

    def choose(self, mode: Mode) -> None:
        """Note a requested mode, even if it is the present one."""
        ...

    def enter(self, mode: Mode) -> None:
        """Begin a mode, no matter who requested it."""
        ...

    def intervene(
        self, mode: Mode, *, armed: bool, arrived: bool, now: float
    ) -> Intervention | None:
        """Check the time-outs, once per control step; return the resulting action, or None.

        ``arrived``: AUTO or RTL has reached the end of its route.
        """
        ...

    def position_lost(self) -> Intervention:
        """Return the reaction to a lost position, while armed in a mode that needs one."""
        ...

    def fence_breached(self) -> Intervention:
        """Return the reaction to leaving the fence, while armed."""
        ...

    def hear_heartbeat(self, system_id: int, *, now: float) -> None:
        """Note a heartbeat from any system."""
        ...

    def take_local(self, message: Local, estimate: Estimate, *, mode: Mode, now: float) -> None:
        """Take SET_POSITION_TARGET_LOCAL_NED, in any mode."""
        ...

    def take_global(self, message: Global, estimate: Estimate, *, mode: Mode, now: float) -> None:
        """Take SET_POSITION_TARGET_GLOBAL_INT, in any mode."""
        ...

    def go_to(self, destination: Destination | None, *, now: float) -> None:
        """Take the place of DO_REPOSITION, in ``reposition_mode``; None: stay here."""
        ...

    def change_speed(self, speed: float, mode: Mode) -> bool:
        """Take DO_CHANGE_SPEED, m/s; return False if refused."""
        ...

    def follow_setpoints(self, estimate: Estimate, *, now: float) -> Demand:
        """Return the demand in GUIDED."""
        ...

    def steer_to(self, estimate: Estimate, place: Destination, speed_limit: float) -> Demand | None:
        """Return the demand in AUTO and RTL; None on arrival."""
        ...

    def hold(self, estimate: Estimate) -> Demand:
        """Return the demand in HOLD."""
        ...

    def mission_route(self, home: Destination) -> Route | None:
        """Return the route of AUTO, or None if there is none."""
        ...

    @property
    def cruise_speed(self) -> float:
        """Speed of AUTO and RTL, m/s."""
        ...
