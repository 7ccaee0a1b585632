"""The faults that a test can cause in a simulated rover, as one value."""

from dataclasses import dataclass

from rover_sim.actuators import Actuator


@dataclass(frozen=True, slots=True)
class Faults:
    """Faults of one rover; they last until another value replaces this one."""

    silent: bool = False  # runs on, but sends nothing
    deaf: bool = False  # receives nothing; with silent: a dead link
    position_frozen: bool = False  # position and velocity estimates repeat their last value
    position_jump: tuple[float, float] = (0.0, 0.0)  # m north, east, added to the estimate
    says_it_stands: bool = False  # velocity and turn rate of the estimate are zero
    heading_error: float = 0.0  # rad, added to the heading; position and velocity stay correct
    heading_frozen: bool = False
    not_finite: bool = False  # ATTITUDE and LOCAL_POSITION_NED contain only NaN
    clock_frozen: bool = False  # time_boot_ms stops
    outputs_frozen: frozenset[Actuator] = frozenset()  # these keep their values while armed
    wheels_blocked: frozenset[Actuator] = frozenset()  # those of a side, or of both
    gps_lost: bool = False  # no satellites; the position lasts for some seconds
    outside_fence: bool = False  # outside the autopilot's own fence, which is enabled meanwhile
    refuse_arm: bool = False  # even if forced
    refuse_mode: bool = False  # from clients; the operator's switch works
    battery: int = 100  # percent that SYS_STATUS reports; -1: not known
    withheld: frozenset[int] = frozenset()  # ids of messages that are not sent


NO_FAULTS = Faults()
