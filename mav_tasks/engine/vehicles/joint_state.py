"""The state of joint control, as one value: it decides who may move a vehicle."""

from enum import Enum, Flag, auto
from typing import NamedTuple


class Queue(Enum):
    """Whether waiting tasks start."""

    #: tasks start, one after the other
    RUNS = auto()
    #: paused by somebody, or by a restart
    PAUSED = auto()
    #: somebody else, or a failsafe, has the vehicle
    TAKEN = auto()
    #: STOP is latched
    STOPPED = auto()


class Grip(Enum):
    """How far our control of the vehicle goes."""

    #: we send nothing
    FREE = auto()
    #: we ask for modes and arming; it does not move
    TAKING = auto()
    #: it follows our set-points
    DRIVING = auto()
    #: it stands; we ask for HOLD, then for disarming
    RELEASING = auto()
    #: the stop ladder, until it is seen to stand
    STOPPING = auto()


class Work(Enum):
    """What the tasks of the vehicle are doing."""

    #: no task
    NONE = auto()
    #: tasks wait, none is active
    WAITS = auto()
    #: the active task starts or drives
    RUNS = auto()
    #: the active task is being cancelled, and comes to a stop
    ENDS = auto()
    #: the active task waits until the vehicle, or its position, is heard again
    LOST = auto()
    #: the active task is paused or held
    STANDS = auto()
    #: the active task stands because somebody else has the vehicle
    TAKEN = auto()


class Driver(Enum):
    """Who else's set-points or stick input were seen just now."""

    NOBODY = auto()
    #: a client with a grant to drive through us
    CLIENT = auto()
    #: a person at the sticks, or a second controller
    OTHERS = auto()


class Waits(Flag):
    """Earlier requests that may still move the vehicle later."""

    #: a "go to" that may follow a HOLD and undo it
    GO_TO = auto()
    #: the mission, which starts when the vehicle is armed
    START = auto()
    #: a held task that was released
    RELEASE = auto()
    #: a client's grant of the mode in which it drives
    GRANT = auto()


NOTHING = Waits(0)


class State(NamedTuple):
    """Everything that decides what follows from an event."""

    queue: Queue = Queue.RUNS
    grip: Grip = Grip.FREE
    work: Work = Work.NONE
    driver: Driver = Driver.NOBODY
    armed: bool = False
    may_be_armed: bool = False  # or a client asked for arming, which no heartbeat shows yet
    may_arm: bool = True  # we may arm it without a client's request
    waits: Waits = NOTHING
    is_led: bool = False  # in a mode set by somebody else, in which no task starts
    is_urgent: bool = False  # a task must run although the queue is paused
    is_idle: bool = True  # no task is active, and none could start now
    is_stopping: bool = False  # it was told to stand and is not yet seen to stand
    is_late: bool = False  # packets sent before the last STOP may still arrive
    lingers: bool = False  # persona: a "go to" may follow HOLD and undo it
    has_failsafe: bool = False  # persona: it leaves our mode when set-points end
    heeds_stick: bool = False  # persona: it takes a stick as a speed, also in our mode
    brakes: bool = False  # set-points stop it sooner than HOLD, also against a held stick
