"""How closely a simulated rover imitates a real one: estimator, boot, links, drive train.

Values only; the parts that read them do the work. The figures come from recordings of real
autopilots (ArduPilot Rover 4.6.3, PX4 1.17.0, each on its own simulated vehicle).
"""

from dataclasses import dataclass, fields
from enum import Enum, Flag, auto
from math import radians

from rover_sim.frames import Frame


class Change(Flag):
    """A change that triggers a HEARTBEAT before its second is over."""

    NOTHING = 0
    MODE = auto()
    ARMING = auto()


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
    yaw: Wander  # rad


@dataclass(frozen=True, slots=True)
class EstimatorError:
    """Errors of the estimate. Each axis wanders independently, drawn from the seed."""

    forward_speed: Wander  # m/s; recorded: the fixed part turns with the rover
    lateral_speed: Wander  # m/s to the right
    position: Wander  # m, north and east
    yaw: Wander  # rad
    yaw_rate: Wander  # rad/s
    drift: Wander | None = None  # m, north and east, over minutes; None: included in position
    pushing: PushingError | None = None  # None: pushing has no effect


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
    announces: Change  # changes that trigger a HEARTBEAT at once


@dataclass(frozen=True, slots=True)
class Realism:
    """How closely the rover imitates a real one."""

    estimator: EstimatorError | None  # None: the estimate is the truth
    boot: BootTimes
    timing: LinkTiming
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

ARDUPILOT_BOOT = BootTimes(  # recorded, s from the first message
    initialised=1.0,
    mode_lost=2.2,
    heading=0.0,
    fix=9.7,
    position=10.2,
    origin=21.0,
    healthy=23.3,
    armable=23.4,  # refused at 22.2, accepted at the next attempt at 25.1
    uses_gps=41.8,
)
PX4_BOOT = BootTimes(
    initialised=0.0,
    mode_lost=0.0,
    heading=1.0,
    fix=0.0,
    position=0.0,
    origin=1.0,
    healthy=4.0,
    armable=4.1,
    uses_gps=float("inf"),
)

ARDUPILOT_ESTIMATOR = {
    Gps.FINE: EstimatorError(  # standing 0.029 / 0.035 m/s, 0.02 m; yaw +0.7 to +1.1 deg
        forward_speed=Wander(0.0045, 1.6, least=-0.0195, most=-0.0185),
        lateral_speed=Wander(0.0045, 1.6, least=0.0185, most=0.0195),
        position=Wander(0.018, 8.0),
        yaw=Wander(radians(0.1), 20.0, least=radians(0.9), most=radians(1.0)),
        yaw_rate=Wander(radians(0.015), 0.5, least=radians(0.035), most=radians(0.05)),
    ),
    Gps.METRE: EstimatorError(  # as with noisy sensors, standing 0.037 / 0.059 m/s
        forward_speed=Wander(0.015, 2.0, least=-0.026, most=-0.018),
        lateral_speed=Wander(0.015, 2.0, least=0.018, most=0.026),
        position=Wander(0.032, 1.0),  # PX4's: that recording had noisy speed only
        yaw=Wander(radians(0.1), 20.0, least=radians(0.9), most=radians(1.0)),
        yaw_rate=Wander(radians(0.015), 0.5, least=radians(0.035), most=radians(0.05)),
        drift=Wander(0.15, 35.0),
    ),
}
PX4_ESTIMATOR = {
    Gps.FINE: EstimatorError(  # standing 0.003 / 0.006 m/s, 0.006 m; yaw -0.1 to +0.1 deg
        forward_speed=Wander(0.0033, 0.6),
        lateral_speed=Wander(0.0033, 0.6),
        position=Wander(0.003, 1.0),
        yaw=Wander(radians(0.06), 20.0),
        yaw_rate=Wander(radians(0.022), 0.5),
        drift=Wander(0.009, 40.0),  # 0.01 / 0.03 m over a drive, 0.03 and 0.06 m at most
    ),
    Gps.METRE: EstimatorError(  # standing 0.037 / 0.064 m/s, 0.08 m; yaw -1.5 to +0.7 deg
        forward_speed=Wander(0.028, 1.3, least=0.0, most=0.016),
        lateral_speed=Wander(0.028, 1.3, least=0.0, most=0.016),
        position=Wander(0.032, 1.0),
        yaw=Wander(radians(0.14), 2.0, least=radians(0.3), most=radians(0.6)),
        yaw_rate=Wander(radians(0.36), 0.25),
        drift=Wander(0.15, 35.0),  # 0.18 / 0.43 m over a drive, 0.7 m at most
    ),
}
# standing after pushing 0.284 / 0.472 m/s; yaw -4.8 to +9.2 deg once, -5.5 to +1.9 another time
PUSHING = PushingError(speed=Wander(0.22, 1.2), yaw=Wander(radians(7.3), 12.0))

# m/s at full throttle, CRUISE_SPEED / CRUISE_THROTTLE of SITL's frames: 3 / 0.75, 5 / 0.3.
# Recorded at 1750: 1.9 m/s on skid steer; 2.6 to 3.1 m/s within 3 s on Ackermann, and still rising
STICK_SPEEDS = {Frame.SKID: 4.0, Frame.DIFFERENTIAL: 4.0, Frame.ACKERMANN: 16.7}

ARDUPILOT_TIMING = LinkTiming(0.010, 0.024, in_pairs=True, announces=Change.MODE)
PX4_TIMING = LinkTiming(0.004, 0.062, in_pairs=False, announces=Change.NOTHING)

ARDUPILOT_REALISM = Realism(
    estimator=ARDUPILOT_ESTIMATOR[Gps.FINE],
    boot=ARDUPILOT_BOOT.scaled(SHORT),
    timing=ARDUPILOT_TIMING,
    stick_speed=STICK_SPEEDS[Frame.SKID],
)
PX4_REALISM = Realism(
    estimator=PX4_ESTIMATOR[Gps.FINE],
    boot=PX4_BOOT.scaled(SHORT),
    timing=PX4_TIMING,
)
