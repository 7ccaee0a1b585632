"""The interface between tasks and a vehicle: what tasks see and demand. It has no MAVLink."""

from dataclasses import dataclass
from enum import Enum, auto

from mav_tasks.config.settings import DEFAULT_TURNING_RADIUS, Turning, Watch
from mav_tasks.kinds import GlobalPlace, GoTo, LocalPlace, SingleGoal
from mav_tasks.kinds.guidance import ZERO, Motion, Velocity
from mav_tasks.tasks.driving.frames import local_place
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import Frame


class ModeKind(Enum):
    """Kind of a vehicle's mode, by what it means for taking control."""

    #: takes our setpoints, and we (or a client through us) have set it
    OURS = auto()
    #: stands and waits
    HOLD = auto()
    #: a person drives
    MANUAL = auto()
    #: anything else: its own mission, return, or a mode that somebody else set
    OTHER = auto()


@dataclass(frozen=True, slots=True)
class VehicleView:
    """Snapshot of a vehicle."""

    heard: bool  # heartbeats are coming
    mode: ModeKind
    armed: bool
    may_arm: bool  # allowed by setting, and not withdrawn by another's disarm or mode change
    in_control: bool  # in our mode, seen armed, zero setpoint sent
    refusal: TaskReason  # why control could not be taken, or NONE
    motion: Motion | None  # the last measured, however old
    still: bool  # measured to stand still
    other_controller: bool  # somebody else's setpoints were seen just now
    frame: Frame | None = None  # of the positions, if it is known
    home: GlobalPlace | None = None  # where it returns to
    is_home_old: bool = False  # home may have moved, and the vehicle is about to say where to
    is_fence_unknown: bool = False  # there is a fence, but its place in this frame is unknown
    is_outside_own_fence: bool = False  # as the vehicle itself reports
    honours_yaw_rate: bool = True  # and reverses; otherwise it is steered by course
    turning: Turning = Turning.ON_SPOT
    turns_by_course: bool = False  # it turns on the spot to a commanded course
    turning_radius: float = DEFAULT_TURNING_RADIUS  # m, if it is STEERED
    is_unknown: bool = False  # not known yet: which vehicle it is, or who else controls it
    is_not_ready: bool = False  # arming was refused, but may succeed later
    why_not_ready: str = ""  # in the vehicle's own recent words
    is_untouched: bool = False  # it is being taken, but no request was sent yet
    is_booting: bool = False  # it shows a booting mode, and accepts no other yet
    drives_on: bool = False  # it must stop without setpoints (a setting), but may not
    is_engaged: bool = False  # the server is doing something to it
    is_ours: bool = True  # False: the gateway's lease is not renewed, another one may get it

    @property
    def origin(self) -> GlobalPlace | None:
        """Origin of the local frame on earth, if it is known."""
        frame = self.frame
        if frame is None or frame.latitude_degE7 is None or frame.longitude_degE7 is None:
            return None
        return GlobalPlace(frame.latitude_degE7, frame.longitude_degE7)


class DemandKind(Enum):
    """Kind of a demand on a vehicle."""

    #: take control without moving
    TAKE = auto()
    #: send this velocity (zero included)
    DRIVE = auto()
    #: zeros until it stands, then the mode HOLD, then silence
    HOLD = auto()
    #: as HOLD, and disarm it if we armed it
    HAND_BACK = auto()
    #: zeros and the mode HOLD at once, both until confirmed
    STOP = auto()
    #: as STOP, and repeated until it stands
    HALT = auto()


@dataclass(frozen=True, slots=True)
class Demand:
    """A demand on a vehicle; only DRIVE uses the velocity."""

    kind: DemandKind
    velocity: Velocity = ZERO


STAND = Demand(DemandKind.DRIVE, ZERO)
TAKE = Demand(DemandKind.TAKE)
HOLD = Demand(DemandKind.HOLD)
HAND_BACK = Demand(DemandKind.HAND_BACK)
STOP = Demand(DemandKind.STOP)
HALT = Demand(DemandKind.HALT)


def start_blocker(
    view: VehicleView, *, watch: Watch, now: float, goal: SingleGoal | None = None
) -> TaskReason:
    """Return why no task (or none with this goal) can take control of the vehicle now, or NONE.

    The server takes over only from HOLD, from a mode that it set, or from MANUAL while disarmed.
    """
    if not view.is_ours:
        return TaskReason.LEASE_LOST
    if not view.heard or view.is_unknown:
        return TaskReason.VEHICLE_SILENT
    if view.other_controller:
        return TaskReason.OTHER_CONTROLLER
    if view.is_booting:
        return TaskReason.NOT_READY
    if view.mode is ModeKind.OTHER or (view.mode is ModeKind.MANUAL and view.armed):
        return TaskReason.WRONG_MODE
    is_old = view.motion is None or now - view.motion.at > watch.motion_fresh
    if is_old or view.is_fence_unknown:
        return TaskReason.NO_POSITION
    if isinstance(goal, GoTo) and place_of(goal, view) is None:
        return TaskReason.NO_POSITION
    if not view.armed and not view.may_arm:
        return TaskReason.DISARMED
    if view.is_outside_own_fence:
        return TaskReason.OUTSIDE_OWN_FENCE
    return TaskReason.LOSS_FAILSAFE if view.drives_on else TaskReason.NONE


def place_of(goal: GoTo, view: VehicleView) -> LocalPlace | None:
    """Return a goal's place in the vehicle's local frame, or None while that is unknown."""
    return local_place(view.home if goal.place is None else goal.place, view.origin)
