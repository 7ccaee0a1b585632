"""What the task domain sees of a vehicle, and what it asks of it. No MAVLink in either."""

from dataclasses import dataclass
from enum import Enum, auto

from mav_tasks.settings import DEFAULT_TURNING_RADIUS, Turning
from mav_tasks.tasks.driving.guidance import ZERO, Motion, Velocity
from mav_tasks.tasks.goal import GlobalPlace
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import Frame


class ModeKind(Enum):
    """A vehicle's mode, by what it means for taking control."""

    #: takes our setpoints, and it was us (or a client through us) who set it
    OURS = auto()
    #: stands and waits
    HOLD = auto()
    #: a person drives
    MANUAL = auto()
    #: anything else: its own mission, return, or a mode that somebody else set
    OTHER = auto()


@dataclass(frozen=True, slots=True)
class VehicleView:
    """One look at a vehicle."""

    heard: bool  # heartbeats are coming
    mode: ModeKind
    armed: bool
    may_arm: bool  # by setting, and not withdrawn by a disarm or mode change not ours
    in_control: bool  # in our mode, seen armed, zero setpoint sent
    refusal: TaskReason  # why control could not be taken, or NONE
    motion: Motion | None  # the last measured, however old
    still: bool  # measured to stand still
    other_controller: bool  # somebody else's setpoints were seen just now
    frame: Frame | None = None  # that positions are in, where it is known
    home: GlobalPlace | None = None  # where it returns to
    is_fence_unknown: bool = False  # there is one, and it cannot be said where in this frame
    is_outside_own_fence: bool = False  # by what it says itself
    honours_yaw_rate: bool = True  # and reverses; else it is steered by course
    turning: Turning = Turning.ON_SPOT
    turns_by_course: bool = False  # it turns on the spot to the course that it is told
    turning_radius: float = DEFAULT_TURNING_RADIUS  # m, of one that is STEERED
    is_unknown: bool = False  # it has yet to say whether it is the one whose tasks these are
    is_not_ready: bool = False  # the refusal is of arming, and may be another one later
    why_not_ready: str = ""  # in the vehicle's own words, as far as it has said lately
    is_untouched: bool = False  # nothing has been asked of it yet, while it is being taken
    is_booting: bool = False  # it shows that it is, and takes no mode yet
    drives_on: bool = False  # it is not known to stand when nothing is asked of it, and must

    @property
    def origin(self) -> GlobalPlace | None:
        """Where the local frame begins on earth, if that is known."""
        frame = self.frame
        if frame is None or frame.latitude_degE7 is None or frame.longitude_degE7 is None:
            return None
        return GlobalPlace(frame.latitude_degE7, frame.longitude_degE7)


class DemandKind(Enum):
    """What a vehicle must be made to do now."""

    #: get into control without moving
    TAKE = auto()
    #: this velocity (zero included)
    DRIVE = auto()
    #: zeros until it stands, then the mode HOLD, then silence
    HOLD = auto()
    #: as HOLD, and disarm it if it was us who armed it
    HAND_BACK = auto()
    #: zeros and the mode HOLD at once, both until confirmed
    STOP = auto()
    #: as STOP, and begun anew as long as it does not stand
    HALT = auto()


@dataclass(frozen=True, slots=True)
class Demand:
    """A demand; the velocity is meant for DRIVE only."""

    kind: DemandKind
    velocity: Velocity = ZERO


STAND = Demand(DemandKind.DRIVE, ZERO)
TAKE = Demand(DemandKind.TAKE)
HOLD = Demand(DemandKind.HOLD)
HAND_BACK = Demand(DemandKind.HAND_BACK)
STOP = Demand(DemandKind.STOP)
HALT = Demand(DemandKind.HALT)
