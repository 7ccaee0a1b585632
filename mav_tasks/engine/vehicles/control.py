"""Joint control of one vehicle: its state, and the table of what each request and event does in it.

It decides who may move the vehicle. STOP comes first, then what somebody else did to it, then what
we want.
"""

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


class Event(Enum):
    """What may happen to the control of a vehicle."""

    # requests that halt it
    STOP = auto()
    HOLD = auto()  # a client asks for the mode
    PAUSE = auto()
    PAUSE_TASKS = auto()  # a key was revoked: pause the queue with its tasks
    DISARM = auto()  # a client asks for it
    EMERGENCY_STOP = auto()  # a client asks for it by force: what drives it ends
    CANCEL = auto()  # of the active task
    CLEAR = auto()  # cancel everything, also the active task
    OPERATOR_LOST = auto()
    LEASE_ENDS = auto()  # another gateway may soon have it
    CLOSE = auto()  # the server shuts down
    LEAVE = auto()  # the same for a gateway of a fleet, after LEASE_ENDS: its tasks go on elsewhere
    # observations that halt it
    TAKEN = auto()  # somebody else has it, in whatever way
    MODE = auto()  # it shows a mode that we did not ask for
    LAPSED = auto()  # it shows HOLD while set-points stream: a failsafe's, or somebody's
    LAPSED_WITH_LEASE = auto()  # the same, surely a failsafe's: set-points ended with the lease
    LATE_MODE = auto()  # it shows a mode that a client asked for before a halt
    LATE_ARMING = auto()  # it shows armed, by a request from before a disarming or STOP
    EXPLAINED = auto()  # a text explains the takeover: a failsafe's
    MODE_IN_STOP = auto()  # the same, while STOP is latched
    DISARMED = auto()  # it shows disarmed, not by us
    PARKED = auto()  # somebody who was driving has set HOLD
    STICK = auto()  # a stick is off its centre, in our mode
    DRIVEN_BY_HAND = auto()  # a client sends manual control
    SECOND = auto()  # a second controller
    REBOOTED = auto()
    LATE = auto()  # our tick was late: it drove on without us
    TOO_FAST = auto()
    NOT_STANDING = auto()  # it moves although a task tells it to stand
    HEARD_AGAIN = auto()
    # requests that let it go
    CONTINUE = auto()
    GO_ON = auto()  # a "go to" revokes the HOLD just before it, or a mission is resumed
    RELEASE = auto()  # of a held task
    RESTORE = auto()  # of a held task, by somebody who may also allow arming again
    RUN_NOW = auto()
    ASK_OUR_MODE = auto()  # a client asks for it, to drive through us
    ASK_OUR_MODE_STREAMING = auto()  # the same; the mode needs a set-point stream, which waits here
    ASK_OTHER_MODE = auto()
    ARM = auto()  # a client asks for it
    # events that move nothing by themselves
    UNQUEUE = auto()  # a waiting task is cancelled
    CLEAR_WAITING = auto()
    SKIP = auto()  # a held task
    DRIVING_ENDS = auto()  # a client that drove asks for something else
    GONE = auto()  # a client that drove has disconnected
    LANDED = auto()  # a client has landed it: disarm it once no task is left
    LEAVE_MODE = auto()  # a client wants it driven while nobody uses the sticks
    COME_BACK = auto()  # a vehicle of an earlier run is found; that run left it standing
    COME_BACK_DRIVING = auto()  # the same, left driving; by all that is seen it drives on
    COME_BACK_DRIVEN = auto()  # the same, left driving, and it may still follow set-points
    COME_BACK_HALTED = auto()  # the same, told to stand just before that run ended
    COME_BACK_LED_AWAY = auto()  # left driving, and in a mode that does not follow set-points


class Effect(Enum):
    """What is done; ``joint_control`` does it."""

    # how it is stopped
    BRAKE = auto()  # the stop ladder: set-points while they brake, then HOLD, then disarming
    HOLD_AT_ONCE = auto()  # the stop ladder without set-points
    LET_GO = auto()  # one zero and HOLD, repeated until it shows
    STEP = auto()  # run the tasks now: a task that stands sends zeros
    WATCH = auto()  # run the stop ladder from here on
    ZERO = auto()  # one zero
    ZERO_KEPT = auto()  # one zero if it may keep a velocity of ours: armed, it would drive off
    ZERO_AND_HOLD = auto()  # once each, and nothing after them
    STAY = auto()  # ask for HOLD although it shows HOLD
    REGAIN = auto()  # it follows the set-points of an earlier run still: it is in our control
    LOSE = auto()  # send nothing more of ours, not even to stop it
    # earlier requests must not take effect later; each halt of the tasks sees to that
    OUTDATE = auto()  # as a halt does: whatever was permitted before counts no more
    FORGET_GO_TO = auto()  # that a "go to" may undo a HOLD
    FORGET_START = auto()  # that a mission starts with the arming
    FORGET_RELEASE = auto()  # a released task that has not started is held again
    REVOKE = auto()  # the grant: a client that wants to drive must ask again
    # the tasks
    COUNT = auto()  # count a halt, so that older requests do not count
    PAUSE = auto()  # queue and active task; the result is its id
    PAUSE_TAKEN = auto()  # the same, after a takeover
    LATCH = auto()  # kill the active task, and start none before a continue; the result is its id
    HOLD_TASK = auto()  # until somebody decides
    DO = auto()  # the request itself; if it raises Rejection, nothing follows
    WAKE = auto()  # run the tasks: one may be ready
    # permissions and reports
    WITHDRAW_ARMING = auto()  # also across a restart of the server
    RESTORE_ARMING = auto()
    OUTDATE_ARMING = auto()  # requests sent earlier, ours or a client's, also copies on their way
    OUTDATE_OUR_ARMING = auto()  # we need it armed no more
    EXPECT_DISARMED = auto()  # it counts as disarmed until it has shown that
    DISARM = auto()  # ask for it until it is answered, also if a person armed the vehicle
    LINGER = auto()  # leave its mode alone, a "go to" may follow
    HAND_OVER = auto()  # a client takes the vehicle while we hand it back
    KEEP_ARMED = auto()  # when we hand it back
    DISARM_AT_END = auto()  # when we hand it back, also if a person armed it
    NOTE_OTHERS = auto()  # somebody who is not our client is driving
    LEFT = auto()  # a set-point leaves late
    TELL = auto()
    TELL_TAKEN = auto()
    TELL_STICK = auto()
    TELL_HELD = auto()


Step = Effect | Event


class Row(NamedTuple):
    """The effects of an event in the states that ``where`` allows."""

    event: Event
    effects: tuple[Step, ...]
    where: dict[str, frozenset[object]]

    def fits(self, state: State) -> bool:
        """Return whether the row applies to this state."""
        return all(getattr(state, name) in values for name, values in self.where.items())


def _row(event: Event, *effects: Step, **where: object) -> Row:
    """Return a row; each of ``where`` is one value or a tuple of values."""
    values = {
        name: frozenset(value if isinstance(value, tuple) else (value,))
        for name, value in where.items()
    }
    return Row(event, effects, values)


_E, _F = Event, Effect
ENGAGED = (Grip.TAKING, Grip.DRIVING, Grip.RELEASING)
HAS_IT = (Work.RUNS, Work.ENDS, Work.LOST, Work.STANDS, Work.TAKEN)  # a task is active
GOES_ON = (Work.RUNS, Work.ENDS, Work.LOST)  # the active task continues without a request
STANDS = (Work.NONE, Work.WAITS, Work.STANDS, Work.TAKEN)  # it stands, and stays standing
NO_TASK_HAS_IT = (Work.NONE, Work.WAITS)
IS_LET_RUN = (Queue.RUNS, Queue.PAUSED)

NOT_FREE = (*ENGAGED, Grip.STOPPING)
GOES_INTO_HOLD = (Grip.RELEASING, Grip.STOPPING)

#: somebody has taken it from a task
TAKES = (_F.COUNT, _F.LOSE, _F.TELL_TAKEN, _F.PAUSE_TAKEN)
UNARMS = (_F.COUNT, _F.OUTDATE_ARMING, _F.EXPECT_DISARMED, _F.WITHDRAW_ARMING)
HANDS_OVER = (_F.FORGET_START, _F.DO, _F.HAND_OVER)

TABLE = (
    # requests that halt it
    _row(_E.STOP, _F.OUTDATE_ARMING, _F.LATCH, _F.BRAKE),
    _row(_E.HOLD, _F.COUNT, _F.BRAKE, queue=Queue.STOPPED),
    # a "go to" may still follow
    _row(_E.HOLD, _F.COUNT, _F.LINGER, _F.STEP, grip=Grip.DRIVING, lingers=True, work=Work.NONE),
    _row(_E.HOLD, _F.PAUSE, _F.LINGER, _F.STEP, grip=Grip.DRIVING, lingers=True),
    _row(_E.HOLD, _F.COUNT, _F.LET_GO, work=Work.NONE),
    _row(_E.HOLD, _F.PAUSE, _F.LET_GO),
    # a vehicle that moves without a task is stopped as by HOLD; so is one that was taken over
    _row(_E.PAUSE, _F.PAUSE, _E.HOLD, work=STANDS, grip=Grip.FREE, may_be_armed=True),
    _row(_E.PAUSE, _F.PAUSE, _F.STEP),
    # a client may drive it beside tasks that wait: its velocity must not stay
    _row(_E.PAUSE_TASKS, _E.DRIVING_ENDS, _F.PAUSE, _F.STEP),
    _row(_E.DISARM, _F.PAUSE, *UNARMS, _F.LET_GO, grip=ENGAGED, work=HAS_IT),
    _row(_E.DISARM, *UNARMS, _F.LET_GO, grip=ENGAGED),
    # a stream that ends here would leave a velocity behind
    _row(_E.DISARM, *UNARMS, _F.ZERO, driver=Driver.CLIENT, has_failsafe=False),
    _row(_E.DISARM, *UNARMS),
    _row(_E.EMERGENCY_STOP, _F.DO, _E.DISARM),
    # one that another task replaces is no halt
    _row(_E.CANCEL, _F.OUTDATE_OUR_ARMING, _F.DO, _F.REVOKE, _F.STEP),
    # its late set-point would drive it on
    _row(_E.CLEAR, _F.DO, _F.COUNT, _F.LET_GO, driver=Driver.CLIENT, grip=Grip.FREE),
    _row(_E.CLEAR, _F.OUTDATE_OUR_ARMING, _F.DO, _F.COUNT, _F.STEP),
    _row(_E.OPERATOR_LOST, _F.FORGET_RELEASE, _F.FORGET_START, work=Work.NONE),
    _row(
        _E.OPERATOR_LOST,
        *(_F.FORGET_RELEASE, _F.FORGET_START),
        work=(Work.WAITS, Work.STANDS, Work.TAKEN),
        queue=(Queue.PAUSED, Queue.TAKEN, Queue.STOPPED),
        is_urgent=False,
    ),
    _row(_E.OPERATOR_LOST, _F.FORGET_RELEASE, _F.FORGET_START, _F.TELL, _E.PAUSE),
    _row(_E.LEASE_ENDS, _E.DRIVING_ENDS, _F.OUTDATE, _F.STEP),
    # nobody is left to repeat a zero to one that a client drives
    _row(_E.CLOSE, _F.REVOKE, _F.LET_GO, grip=Grip.FREE, driver=Driver.CLIENT, work=NO_TASK_HAS_IT),
    _row(_E.CLOSE, _F.REVOKE, _F.PAUSE, _F.LET_GO, grip=Grip.FREE, driver=Driver.CLIENT),
    _row(_E.CLOSE, _F.PAUSE, work=HAS_IT, grip=Grip.FREE),
    _row(_E.CLOSE, grip=Grip.FREE),
    _row(_E.CLOSE, _F.PAUSE, _F.BRAKE, work=HAS_IT),
    _row(_E.CLOSE, _F.BRAKE),
    _row(_E.LEAVE, grip=Grip.FREE),
    _row(_E.LEAVE, _F.BRAKE),
    # observations that halt it
    _row(_E.TAKEN, _F.COUNT, queue=Queue.STOPPED),
    _row(_E.TAKEN, *TAKES, work=GOES_ON),  # also a task that runs although the queue is paused
    # it was being stopped: no waiting task may drive it off from where somebody takes it
    _row(_E.TAKEN, *TAKES, work=Work.WAITS, queue=IS_LET_RUN, grip=Grip.STOPPING),
    _row(_E.TAKEN, *TAKES, work=HAS_IT, queue=IS_LET_RUN),
    _row(_E.TAKEN, _F.COUNT, _F.LOSE),
    _row(_E.MODE, _F.WITHDRAW_ARMING, _E.TAKEN),
    # the next set-point under way would end a failsafe's HOLD
    _row(_E.LAPSED, _F.WITHDRAW_ARMING, _E.TAKEN, _F.STAY, has_failsafe=True),
    _row(_E.LAPSED, _F.WITHDRAW_ARMING, _E.TAKEN),
    # nobody has taken it: its task goes on with the lease, out of this HOLD
    _row(_E.LAPSED_WITH_LEASE, _F.OUTDATE, _F.LOSE, work=Work.LOST),
    _row(_E.LAPSED_WITH_LEASE, _E.LAPSED),
    # something was let go since: it is a person at the vehicle, or as good as one
    _row(_E.LATE_MODE, _E.MODE, work=(Work.RUNS, Work.LOST)),
    _row(_E.LATE_MODE, grip=GOES_INTO_HOLD),  # we are asking for HOLD
    _row(_E.LATE_MODE, _F.TELL, _F.LET_GO),
    _row(_E.LATE_ARMING, grip=Grip.RELEASING),  # the release disarms it, if it was armed for us
    _row(_E.LATE_ARMING, _F.TELL, _F.DISARM, queue=Queue.STOPPED),
    _row(_E.LATE_ARMING, _F.TELL, _F.DISARM, work=Work.NONE),
    _row(_E.LATE_ARMING, _F.TELL, _F.DISARM, _F.PAUSE),  # or a waiting task would arm it
    _row(_E.EXPLAINED, _F.TELL, _F.PAUSE_TAKEN),
    # a late request from before the STOP; later, it is a person at the vehicle
    _row(_E.MODE_IN_STOP, _F.WITHDRAW_ARMING, _F.BRAKE, is_late=True, grip=Grip.FREE),
    _row(_E.MODE_IN_STOP, _F.WITHDRAW_ARMING),
    _row(_E.DISARMED, _F.WITHDRAW_ARMING, _F.OUTDATE_OUR_ARMING, _F.ZERO_KEPT, _E.TAKEN),
    _row(_E.PARKED, _F.PAUSE_TAKEN, work=(Work.WAITS, *HAS_IT), queue=IS_LET_RUN),
    _row(_E.PARKED),
    # zeros do not stop it, and nobody can steer it by the stick
    _row(_E.STICK, grip=Grip.FREE),
    _row(_E.STICK, _F.FORGET_RELEASE, grip=GOES_INTO_HOLD, work=STANDS),
    _row(_E.STICK, _F.TELL_STICK, _F.NOTE_OTHERS, _F.PAUSE_TAKEN, grip=Grip.STOPPING),
    # it is already being stopped because of the stick
    _row(_E.STICK, _F.FORGET_RELEASE, queue=Queue.TAKEN, is_stopping=True, work=STANDS),
    _row(_E.STICK, _F.TELL_STICK, _F.NOTE_OTHERS, _F.PAUSE_TAKEN, _F.STEP, _F.WATCH, brakes=True),
    _row(_E.STICK, _F.TELL_STICK, _F.NOTE_OTHERS, _F.PAUSE_TAKEN, _F.LET_GO, _F.WATCH),
    _row(_E.DRIVEN_BY_HAND, _F.NOTE_OTHERS, _E.STICK, heeds_stick=True, grip=NOT_FREE),
    _row(_E.DRIVEN_BY_HAND, _F.NOTE_OTHERS, _F.ZERO_KEPT, _E.TAKEN),
    _row(_E.SECOND, _F.TELL, _F.COUNT, _F.NOTE_OTHERS, _E.SECOND, driver=Driver.NOBODY),
    _row(_E.SECOND, _F.NOTE_OTHERS, grip=Grip.STOPPING),
    _row(
        _E.SECOND,
        *(_F.COUNT, _F.NOTE_OTHERS, _F.ZERO),
        driver=Driver.CLIENT,
        grip=Grip.FREE,
        work=NO_TASK_HAS_IT,
    ),
    _row(_E.SECOND, _F.OUTDATE, _F.NOTE_OTHERS, grip=Grip.FREE, work=NO_TASK_HAS_IT),
    _row(_E.SECOND, _F.NOTE_OTHERS, _E.TAKEN, grip=Grip.FREE),
    _row(_E.SECOND, _F.NOTE_OTHERS, _F.ZERO_AND_HOLD, _E.TAKEN),
    _row(_E.REBOOTED, _F.OUTDATE, _F.TELL, queue=Queue.STOPPED),
    # it may be a late report of its start: HOLD does no harm to a restarted vehicle
    _row(
        _E.REBOOTED,
        *(_F.OUTDATE, _F.DO),
        grip=GOES_INTO_HOLD,
        work=(Work.NONE, Work.WAITS, Work.STANDS),
    ),
    _row(_E.REBOOTED, _F.OUTDATE, _F.LOSE, _F.DO),
    _row(_E.LATE, _F.LET_GO, _F.LEFT, _F.HOLD_TASK, has_failsafe=True),  # a zero would end it
    _row(_E.LATE, _F.ZERO, _F.LEFT, _F.HOLD_TASK),
    _row(_E.TOO_FAST, _F.TELL, _F.HOLD_TASK, _F.HOLD_AT_ONCE),  # a held stick defeats set-points
    _row(_E.NOT_STANDING, _F.TELL, _F.HOLD_TASK, _F.BRAKE),
    _row(_E.HEARD_AGAIN, _F.BRAKE, grip=Grip.STOPPING),
    _row(_E.HEARD_AGAIN),
    # requests that let it go
    _row(_E.CONTINUE, _F.DO, _F.RESTORE_ARMING, _F.TELL_HELD, _F.WAKE),
    # ends a pause; nobody has said that it may be armed again
    _row(_E.GO_ON, _F.DO, _E.LEAVE_MODE, _F.WAKE, queue=(Queue.PAUSED, Queue.TAKEN)),
    _row(_E.GO_ON),
    _row(_E.RELEASE, _F.DO, _F.WAKE),
    _row(_E.RESTORE, _F.DO, _F.RESTORE_ARMING, _F.WAKE),
    _row(_E.RUN_NOW, _F.FORGET_GO_TO, _F.DO, _F.TELL_HELD, _E.LEAVE_MODE, _F.STEP),
    _row(_E.ASK_OUR_MODE, *HANDS_OVER),
    _row(
        _E.ASK_OUR_MODE_STREAMING,
        *(*HANDS_OVER, _F.ZERO, _F.ZERO),
        grip=Grip.FREE,
        work=NO_TASK_HAS_IT,
    ),
    _row(_E.ASK_OUR_MODE_STREAMING, *HANDS_OVER),
    _row(_E.ASK_OTHER_MODE, *HANDS_OVER, _E.TAKEN, grip=Grip.TAKING),
    _row(_E.ASK_OTHER_MODE, *HANDS_OVER),
    _row(_E.ARM, _F.DO, _F.KEEP_ARMED),
    # events that move nothing by themselves
    _row(_E.UNQUEUE, _F.FORGET_GO_TO, _F.FORGET_START, _F.DO),
    _row(_E.CLEAR_WAITING, _F.FORGET_GO_TO, _F.FORGET_START, _F.DO),
    _row(_E.SKIP, _F.DO, _F.REVOKE, _F.WAKE),
    _row(_E.DRIVING_ENDS, driver=(Driver.NOBODY, Driver.OTHERS)),
    _row(_E.DRIVING_ENDS, _F.REVOKE, grip=NOT_FREE),
    _row(_E.DRIVING_ENDS, _F.REVOKE, _F.LET_GO, has_failsafe=True),
    _row(_E.DRIVING_ENDS, _F.REVOKE, _F.ZERO, _F.ZERO),  # one may be lost
    # stop it without waiting for its own timeout
    _row(
        _E.GONE,
        _F.ZERO,
        driver=(Driver.CLIENT, Driver.OTHERS),
        grip=Grip.FREE,
        has_failsafe=False,
    ),
    _row(_E.GONE),
    _row(_E.LANDED, _F.DISARM_AT_END, _F.LET_GO, armed=True, is_idle=True, grip=Grip.FREE),
    _row(_E.LANDED, _F.DISARM_AT_END),
    _row(_E.LEAVE_MODE, _F.LET_GO, is_led=True, grip=Grip.FREE),
    _row(_E.LEAVE_MODE),
    _row(_E.COME_BACK, _F.BRAKE, queue=Queue.STOPPED),
    _row(_E.COME_BACK),
    # in HOLD a car rolls on or drives a loop; set-points brake it, and it gets HOLD when it stands
    _row(_E.COME_BACK_DRIVING, _F.REGAIN, _F.BRAKE, queue=Queue.STOPPED),
    _row(_E.COME_BACK_DRIVING, _F.REGAIN),
    _row(_E.COME_BACK_DRIVEN, _F.BRAKE, queue=Queue.STOPPED),
    _row(_E.COME_BACK_DRIVEN, queue=Queue.TAKEN, armed=False),  # somebody has it, and it stands
    _row(_E.COME_BACK_DRIVEN, _F.LET_GO),
    _row(_E.COME_BACK_HALTED, _F.BRAKE, queue=Queue.STOPPED),
    _row(_E.COME_BACK_HALTED, _F.LET_GO),
    _row(_E.COME_BACK_LED_AWAY, _F.BRAKE, queue=Queue.STOPPED),
    _row(_E.COME_BACK_LED_AWAY, _F.TELL, has_failsafe=True),  # a zero would renew its failsafe
    _row(_E.COME_BACK_LED_AWAY, _F.ZERO),
)

_ROWS = {event: tuple(row for row in TABLE if row.event is event) for event in Event}


def effects_of(event: Event, state: State) -> tuple[Step, ...]:
    """Return what is done about an event, in order. Raise LookupError if no row fits."""
    for row in _ROWS[event]:
        if row.fits(state):
            return row.effects
    raise LookupError(f"{event.name} has no row for {state}")
