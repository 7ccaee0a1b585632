"""What one make's flight stack decides otherwise than another's: the seam behind ``flight``.

``flight`` does what every make does; it asks the rules of its persona for the rest.
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
from rover_sim.realism import Drive
from rover_sim.route import Route
from rover_sim.setpoints import Destination, Global, Local, Target
from rover_sim.steering import Demand

SETTLING_TIME = 0.5  # s after start until the position estimate is good for arming


@dataclass(frozen=True, slots=True)
class FlightParts:
    """What rules are made from."""

    origin: Origin
    parameters: Parameters
    missions: MissionStorage
    outbox: Outbox
    speed_limit: Callable[[], float]  # m/s
    honours_yaw_rate: bool
    started: float  # s
    frame: Frame
    drive: Drive
    settling_time: float = SETTLING_TIME  # s; 0 where a boot says when it can be armed


class Intervention(NamedTuple):
    """What a flight stack does by itself, unasked."""

    mode: Mode | None = None
    disarm: bool = False
    disarm_text: str | None = None  # None: as on anybody's command


class FlightRules(Protocol):
    """Modes, arming, setpoints and failsafes of one make."""

    reposition_mode: Mode  # in which it drives to the place of DO_REPOSITION
    sticks_present: bool  # somebody holds the sticks of its remote control
    no_position_text: str  # with which arming is refused then
    home_is_where_armed: bool  # else where it was switched on

    @property
    def target(self) -> Target | None:
        """What the setpoints ask for, in GUIDED."""
        ...

    @property
    def hold_destination(self) -> Destination | None:
        """Where it drives to in HOLD, if anywhere."""
        ...

    def system_status(self, mode: Mode, *, armed: bool) -> MavState:
        """Return MAV_STATE."""
        ...

    def arming_text(self, *, armed: bool) -> str:
        """Return the text that tells of arming or disarming."""
        ...

    def unknown_mode(self, custom_mode: int) -> str:
        """Return the text for a number that is no mode."""
        ...

    def mode_refusal(self, wanted: Mode, present: Mode, *, now: float) -> str | None:
        """Return the text with which a client's mode change is refused; None: it may be."""
        ...

    def arming_refusal(self, mode: Mode, *, forced: bool, now: float) -> str | None:
        """Return the text with which arming is refused; None: it may be."""
        ...

    def intended(self, mode: Mode) -> Mode:
        """Return what somebody asked for last, which a failsafe does not change."""
        ...

    def choose(self, mode: Mode) -> None:
        """Note what somebody asked for, also when it is the present mode."""
        ...

    def enter(self, mode: Mode) -> None:
        """Begin a mode, whoever wanted it."""
        ...

    def intervene(
        self, mode: Mode, *, armed: bool, arrived: bool, now: float
    ) -> Intervention | None:
        """Look at the clock, once per control step; give what follows from it.

        ``arrived``: the way that AUTO or RTL drives is at its end.
        """
        ...

    def position_lost(self) -> Intervention:
        """Say what it does, armed in a mode that needs a position, when that is gone."""
        ...

    def fence_breached(self) -> Intervention:
        """Say what it does, armed, when it has left its own fence."""
        ...

    def hear_heartbeat(self, system_id: int, *, now: float) -> None:
        """Note a heartbeat of any system."""
        ...

    def take_local(self, message: Local, estimate: Estimate, *, mode: Mode, now: float) -> None:
        """Take SET_POSITION_TARGET_LOCAL_NED, in whatever mode."""
        ...

    def take_global(self, message: Global, estimate: Estimate, *, mode: Mode, now: float) -> None:
        """Take SET_POSITION_TARGET_GLOBAL_INT, in whatever mode."""
        ...

    def go_to(self, destination: Destination | None, *, now: float) -> None:
        """Take the place of DO_REPOSITION, in ``reposition_mode``; None: stay here."""
        ...

    def change_speed(self, speed: float, mode: Mode) -> bool:
        """Take DO_CHANGE_SPEED, m/s; False: refused."""
        ...

    def follow_setpoints(self, estimate: Estimate, *, now: float) -> Demand:
        """Say how to move in GUIDED."""
        ...

    def steer_to(self, estimate: Estimate, place: Destination, speed_limit: float) -> Demand | None:
        """Say how to move in AUTO and RTL; None once there."""
        ...

    def hold(self, estimate: Estimate) -> Demand:
        """Say how to move in HOLD."""
        ...

    def mission_route(self, home: Destination) -> Route | None:
        """Return what AUTO drives; None: nothing."""
        ...

    @property
    def cruise_speed(self) -> float:
        """How fast AUTO and RTL drive, m/s."""
        ...
