"""How closely a simulated rover imitates a real one: estimator, boot, links, drive train.

Values only; the parts that read them do the work. The figures of each persona come from recordings
of real autopilots (ArduPilot Rover 4.6.3, PX4 1.17.0, each on its own simulated vehicle).
"""

from dataclasses import dataclass, fields
from enum import Enum


class Gps(Enum):
    """The class of the satellite receiver."""

    FINE = "fine"  # centimetres
    METRE = "metre"  # 0.2 m and 0.06 to 0.08 m/s of noise


@dataclass(frozen=True, slots=True)
class Wander:
    """An error that wanders over seconds about a fixed value: a Gauss-Markov process.

    Not white noise: neighbouring samples are nearly equal, and averaging over a second hardly
    helps.
    """

    spread: float  # standard deviation of one axis, about the fixed value
    time: float  # s, of each of two lags: correlation 0.74 after this time, 0.2 after three times
    least: float = 0.0  # the fixed value is drawn between ``least`` and ``most``
    most: float = 0.0


@dataclass(frozen=True, slots=True)
class PushingError:
    """Additional estimation error after the rover pushed against an obstacle."""

    speed: Wander  # m/s, forward and to the right
    yaw: Wander  # deg


@dataclass(frozen=True, slots=True)
class EstimatorError:
    """Errors of the estimate. Each axis wanders independently, drawn from the seed."""

    forward_speed: Wander  # m/s; recorded: the fixed part turns with the rover
    lateral_speed: Wander  # m/s to the right
    position: Wander  # m, north and east
    yaw: Wander  # deg
    yaw_rate: Wander  # deg/s
    drift: Wander | None = None  # m, north and east, over minutes; None: included in position


@dataclass(frozen=True, slots=True)
class BootTimes:
    """Times at which parts of the autopilot are ready, s after power-on."""

    initialised: float  # ArduPilot: INITIALISING ends, in MANUAL; arming then reports its reason
    mode_lost: float  # a mode entered earlier is lost, once: ArduPilot is in MANUAL again
    heading: float  # the estimate has a heading; before, it reports north
    fix: float  # the receiver has a position
    position: float  # the estimate has a position; home has one, but no altitude
    origin: float  # GPS_GLOBAL_ORIGIN, and a complete home
    healthy: float  # the pre-arm bit of SYS_STATUS
    armable: float
    uses_gps: float  # the text that reports it

    @property
    def is_none(self) -> bool:
        """Whether the boot takes no time."""
        return self.healthy == 0.0

    def scaled(self, factor: float) -> "BootTimes":
        """Return the same boot with all times multiplied by ``factor``."""
        return BootTimes(*(getattr(self, field.name) * factor for field in fields(self)))


@dataclass(frozen=True, slots=True)
class LinkTiming:
    """Delays of a link."""

    first_answer: float  # s from a command to its COMMAND_ACK, least
    last_answer: float  # s, most
    in_pairs: bool  # late positions are sent two at a time
    announces_mode: bool  # a new mode triggers a HEARTBEAT before its second is over


@dataclass(frozen=True, slots=True)
class Realism:
    """How closely the rover imitates a real one."""

    boot: BootTimes
    timing: LinkTiming
    estimator: EstimatorError | None = None  # None: the estimate is the truth
    pushing: PushingError | None = None  # None: pushing has no effect
    stick_speed: float | None = None  # m/s at full throttle, in GUIDED. None: ignored
    tells_origin: bool = True  # GPS_GLOBAL_ORIGIN


NO_BOOT = BootTimes(  # everything but arming is ready at once, and arming as fast as tests need it
    initialised=0.25,
    mode_lost=0.0,
    heading=0.0,
    fix=0.0,
    position=0.0,
    origin=0.0,
    healthy=0.0,
    armable=0.5,
    uses_gps=float("inf"),
)
SHORT = 0.05  # of the real times: ArduPilot can be armed after 1.25 s instead of 25 s
