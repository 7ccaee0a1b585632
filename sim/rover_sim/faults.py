"""The things a test can break in a simulated rover, as one value."""

from dataclasses import dataclass

from rover_sim.actuators import Actuator


@dataclass(frozen=True, slots=True)
class Faults:
    """Each fault lasts until another value replaces this one."""

    silent: bool = False  # goes on as before, but sends nothing
    deaf: bool = False  # receives nothing; with silent: a dead link
    position_frozen: bool = False  # position and velocity estimates repeat their last value
    position_jump: tuple[float, float] = (0.0, 0.0)  # m north, east, added to the estimate
    says_it_stands: bool = False  # velocity and turn rate of the estimate are zero
    heading_error: float = 0.0  # rad, added to the heading; position and velocity stay right
    heading_frozen: bool = False
    not_finite: bool = False  # ATTITUDE and LOCAL_POSITION_NED are full of NaN
    clock_frozen: bool = False  # time_boot_ms stays as it is
    outputs_frozen: frozenset[Actuator] = frozenset()  # stay as they were, while it is armed
    gps_lost: bool = False  # no satellites; the position holds for some seconds
    outside_fence: bool = False  # of its own, which is switched on as long as that lasts
    refuse_arm: bool = False  # even a forced one
    refuse_mode: bool = False  # of clients; the operator's switch works
    withheld: frozenset[int] = frozenset()  # ids of messages that are not sent


NO_FAULTS = Faults()
