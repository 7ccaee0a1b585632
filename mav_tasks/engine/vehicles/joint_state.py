"""What decides who may move a vehicle: the state of its joint control, as one value."""

from enum import Enum, Flag, auto
from typing import NamedTuple


class Queue(Enum):
    """Whether waiting tasks begin."""

    #: they do, one after the other
    RUNS = auto()
    #: somebody has paused it, or a restart has
    PAUSED = auto()
    #: somebody else has the vehicle, or its failsafe
    TAKEN = auto()
    #: STOP is latched
    STOPPED = auto()


class Grip(Enum):
    """How far our own hold on the vehicle goes."""

    #: nothing of ours is sent
    FREE = auto()
    #: modes and arming are asked for; it does not move
    TAKING = auto()
    #: it follows our set-points
    DRIVING = auto()
    #: it stands, HOLD is asked for, then disarming
    RELEASING = auto()
    #: the stop ladder, until it is seen to stand
    STOPPING = auto()


class Work(Enum):
    """What there is to do."""

    #: no task
    NONE = auto()
    #: some wait, none has the vehicle
    WAITS = auto()
    #: one starts, or is driven
    RUNS = auto()
    #: one is being cancelled: it comes to stand
    ENDS = auto()
    #: one stands as long as the vehicle, or its position, is not heard of
    LOST = auto()
    #: one is paused or held
    STANDS = auto()
    #: one stands because somebody else has the vehicle
    TAKEN = auto()


class Driver(Enum):
    """Whose set-points or sticks were seen just now, beside our own."""

    NOBODY = auto()
    #: one that was granted, through us
    CLIENT = auto()
    #: a person at the sticks, or a second controller
    OTHERS = auto()


class Waits(Flag):
    """What was asked for, and moves the vehicle later by itself."""

    #: a "go to", by which a HOLD just before is undone
    GO_TO = auto()
    #: the mission, with the arming
    START = auto()
    #: a held task that was released
    RELEASE = auto()
    #: a client that was granted the mode in which it drives
    GRANT = auto()


NOTHING = Waits(0)


class State(NamedTuple):
    """Everything that decides what follows from an event."""

    queue: Queue = Queue.RUNS
    grip: Grip = Grip.FREE
    work: Work = Work.NONE
    driver: Driver = Driver.NOBODY
    armed: bool = False
    may_be_armed: bool = False  # also by a client that has asked for that, and it is not shown yet
    may_arm: bool = True  # we may, of our own accord
    waits: Waits = NOTHING
    is_led: bool = False  # in a mode of somebody else's, in which no task begins
    is_urgent: bool = False  # a task is to run though the queue is paused
    is_idle: bool = True  # no task has begun, and none could begin now
    is_stopping: bool = False  # it is not known yet that it stands, as it was told to
    is_late: bool = False  # what left before the last STOP may still arrive
    lingers: bool = False  # by its make: a "go to" may follow HOLD, and undo it
    has_failsafe: bool = False  # by its make: it leaves our mode when set-points end
    heeds_stick: bool = False  # by its make: it takes a stick for a speed, in our mode too
    brakes: bool = False  # set-points stop it sooner than HOLD, also against a held stick
