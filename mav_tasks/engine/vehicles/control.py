"""Who may move a vehicle, and what follows from each event: the one table of joint control.

Ourselves, clients through us, and somebody at the vehicle want to move it. Whatever happens is an
``Event``; ``effects_of`` gives what is done about it in a ``State``, by name and in order. Who
carries that out (``hands``) decides nothing. Rows are looked through from the top, the first that
fits counts; an event among the effects goes through the table again, in the state as it is then.

The drawing of it is made by ``tools/control_diagram.py``; ``tests/unit/engine/vehicles/
test_control.py`` walks through every state that can be reached.
"""

from enum import Enum, auto
from typing import NamedTuple

from mav_tasks.engine.vehicles.joint_state import Driver, Grip, Queue, State, Work


class Event(Enum):
    """What may happen to a vehicle's control."""

    # words that let it stand
    STOP = auto()
    HOLD = auto()  # the mode, asked for by a client
    PAUSE = auto()
    PAUSE_TASKS = auto()  # a key counts no more: its tasks stand
    DISARM = auto()  # asked for by a client
    CANCEL = auto()  # the task that has the vehicle
    CLEAR = auto()  # whatever has begun, too
    OPERATOR_LOST = auto()
    CLOSE = auto()  # the server ends
    # what was seen, and lets it stand
    TAKEN = auto()  # somebody else has it, in whatever way
    MODE = auto()  # it shows a mode that we have not asked for
    LAPSED = auto()  # it shows HOLD while set-points stream: its failsafe's, or somebody's
    LATE_MODE = auto()  # it shows a mode that a client has asked for before a halt
    LATE_ARMING = auto()  # it shows armed, by what has left before it was to be disarmed or stopped
    EXPLAINED = auto()  # it was its failsafe that has taken it
    MODE_IN_STOP = auto()  # the same, while STOP is latched
    DISARMED = auto()  # it shows that it is, and not by us
    PARKED = auto()  # somebody who was driving has set HOLD
    STICK = auto()  # off its centre, in our mode
    DRIVEN_BY_HAND = auto()  # sticks of a client
    SECOND = auto()  # a second controller
    REBOOTED = auto()
    LATE = auto()  # we were: it drove on without us
    TOO_FAST = auto()
    NOT_STANDING = auto()  # though a task lets it stand
    HEARD_AGAIN = auto()
    # words that let it go
    CONTINUE = auto()
    GO_ON = auto()  # a "go to" shows that a HOLD just before was none, or a mission is started
    RELEASE = auto()  # of a held task
    RESTORE = auto()  # of a held task, by who may also say that all is well
    RUN_NOW = auto()
    ASK_OUR_MODE = auto()  # a client, to drive through us
    ASK_OUR_MODE_STREAMING = auto()  # the same; it is entered in a stream, which waits here
    ASK_OTHER_MODE = auto()
    ARM = auto()  # asked for by a client
    # what moves nothing by itself
    UNQUEUE = auto()  # a task that waits is called off
    CLEAR_WAITING = auto()
    SKIP = auto()  # a held task
    DRIVING_ENDS = auto()  # a client that drove asks for something else
    GONE = auto()  # a client that drove
    LANDED = auto()  # a client has: disarm it once nothing is left to do
    LEAVE_MANUAL = auto()  # a client starts a mission while nobody is at the sticks
    COME_BACK = auto()  # the vehicle of an earlier run, that we left standing
    COME_BACK_DRIVEN = auto()  # the same, left driving, and it may follow set-points still
    COME_BACK_HALTED = auto()  # the same, told to stand just before
    COME_BACK_LED_AWAY = auto()  # the same, in a mode in which it does not


class Effect(Enum):
    """What is done; ``hands`` has a function of the same name for each."""

    # how it stands
    BRAKE = auto()  # the stop ladder: set-points as long as they brake, HOLD, disarming
    HOLD_AT_ONCE = auto()  # the stop ladder without set-points
    LET_GO = auto()  # one zero and HOLD, repeated until it shows
    STEP = auto()  # what the tasks demand, now: zeros of a task that stands
    WATCH = auto()  # climb the stop ladder from here on
    ZERO = auto()  # one zero
    ZERO_KEPT = auto()  # one zero if it may keep a velocity of ours
    ZERO_AND_HOLD = auto()  # once, and nothing after it
    STAY = auto()  # HOLD is shown: ask for it all the same
    LOSE = auto()  # not one thing more is sent of ours
    # what was asked for before does not come true later
    FORGET_GO_TO = auto()
    FORGET_START = auto()
    FORGET_RELEASE = auto()
    REVOKE = auto()
    DROP_WAITING = auto()
    # the tasks
    COUNT = auto()  # a halt, so that older words do not count
    PAUSE = auto()
    PAUSE_TAKEN = auto()
    LATCH = auto()
    HOLD_TASK = auto()
    DO = auto()  # what the word itself asks for; it may be refused, and then nothing follows
    WAKE = auto()  # look at the tasks: one may be ready
    # permissions, and what is told
    WITHDRAW_ARMING = auto()
    RESTORE_ARMING = auto()
    OUTDATE_ARMING = auto()  # what left before, ours or a client's
    OUTDATE_OUR_ARMING = auto()
    EXPECT_DISARMED = auto()
    DISARM = auto()
    LINGER = auto()  # leave its mode alone, a "go to" may follow
    HAND_OVER = auto()
    KEEP_ARMED = auto()
    DISARM_AT_END = auto()
    NOTE_OTHERS = auto()
    LEFT = auto()  # a set-point leaves late
    TELL = auto()
    TELL_TAKEN = auto()
    TELL_STICK = auto()
    TELL_HELD = auto()


Step = Effect | Event


class Row(NamedTuple):
    """What follows from an event where all that ``where`` names is so."""

    event: Event
    effects: tuple[Step, ...]
    where: dict[str, frozenset[object]]

    def fits(self, state: State) -> bool:
        """Whether it is about this state."""
        return all(getattr(state, name) in values for name, values in self.where.items())


def _row(event: Event, *effects: Step, **where: object) -> Row:
    """Make a row; each of ``where`` is one value or several."""
    values = {
        name: frozenset(value if isinstance(value, tuple) else (value,))
        for name, value in where.items()
    }
    return Row(event, effects, values)


_E, _F = Event, Effect
ENGAGED = (Grip.TAKING, Grip.DRIVING, Grip.RELEASING)
HAS_IT = (Work.RUNS, Work.ENDS, Work.LOST, Work.STANDS, Work.TAKEN)  # a task has the vehicle
GOES_ON = (Work.RUNS, Work.ENDS, Work.LOST)  # by itself
STANDS = (Work.NONE, Work.WAITS, Work.STANDS, Work.TAKEN)  # and goes on standing
NO_TASK_HAS_IT = (Work.NONE, Work.WAITS)
IS_LET_RUN = (Queue.RUNS, Queue.PAUSED)

#: nothing that was asked for before moves the vehicle later
TAKE_BACK = (
    _F.FORGET_GO_TO,
    _F.FORGET_START,
    _F.FORGET_RELEASE,
    _F.REVOKE,
    _F.DROP_WAITING,
)
BUT_GO_TO = TAKE_BACK[1:]
UNARMS = (_F.OUTDATE_ARMING, _F.EXPECT_DISARMED, _F.WITHDRAW_ARMING)

TABLE = (
    # words that let it stand
    _row(_E.STOP, *TAKE_BACK, _F.OUTDATE_ARMING, _F.LATCH, _F.BRAKE),
    _row(_E.HOLD, _F.COUNT, _F.BRAKE, queue=Queue.STOPPED),
    _row(
        _E.HOLD,
        *(_F.COUNT, *BUT_GO_TO, _F.LINGER, _F.STEP),
        grip=Grip.DRIVING,
        lingers=True,
        work=Work.NONE,
    ),
    _row(
        _E.HOLD,
        *(_F.COUNT, *BUT_GO_TO, _F.LINGER, _F.PAUSE, _F.STEP),
        grip=Grip.DRIVING,
        lingers=True,
    ),
    _row(_E.HOLD, _F.COUNT, *TAKE_BACK, _F.LET_GO, work=Work.NONE),
    _row(_E.HOLD, _F.COUNT, *TAKE_BACK, _F.PAUSE, _F.LET_GO),
    # one that moves without a task is stopped as by HOLD; so is one that was taken over
    _row(
        _E.PAUSE,
        *(*TAKE_BACK, _F.PAUSE, _E.HOLD),
        work=(Work.NONE, Work.WAITS, Work.STANDS, Work.TAKEN),
        grip=Grip.FREE,
        may_be_armed=True,
    ),
    _row(_E.PAUSE, *TAKE_BACK, _F.PAUSE, _F.STEP),
    _row(_E.PAUSE_TASKS, _F.FORGET_GO_TO, _F.FORGET_START, _F.PAUSE, _F.STEP),
    _row(
        _E.DISARM,
        *(_F.COUNT, *UNARMS, _F.ZERO_KEPT, _E.TAKEN),
        grip=ENGAGED,
    ),
    # a stream that ends here would leave a velocity behind
    _row(
        _E.DISARM,
        *(_F.COUNT, *UNARMS, *TAKE_BACK, _F.ZERO),
        driver=Driver.CLIENT,
        has_failsafe=False,
    ),
    _row(_E.DISARM, _F.COUNT, *UNARMS, *TAKE_BACK),
    _row(
        _E.CANCEL,
        *(_F.FORGET_GO_TO, _F.FORGET_START, _F.OUTDATE_OUR_ARMING, _F.DO, _F.REVOKE, _F.STEP),
    ),
    # a set-point of it that comes late would drive it on
    _row(
        _E.CLEAR,
        *(_F.FORGET_GO_TO, _F.FORGET_START, _F.DO, _F.COUNT, *TAKE_BACK, _F.LET_GO),
        driver=Driver.CLIENT,
        grip=Grip.FREE,
    ),
    _row(
        _E.CLEAR,
        *(_F.FORGET_GO_TO, _F.FORGET_START, _F.OUTDATE_OUR_ARMING, _F.DO, _F.COUNT),
        *(_E.DRIVING_ENDS, *TAKE_BACK, _F.STEP),
    ),
    _row(_E.OPERATOR_LOST, _F.FORGET_RELEASE, _F.FORGET_START, work=Work.NONE),
    _row(
        _E.OPERATOR_LOST,
        *(_F.FORGET_RELEASE, _F.FORGET_START),
        work=(Work.WAITS, Work.STANDS, Work.TAKEN),
        queue=(Queue.PAUSED, Queue.TAKEN, Queue.STOPPED),
        is_urgent=False,
    ),
    _row(_E.OPERATOR_LOST, _F.FORGET_RELEASE, _F.FORGET_START, _F.TELL, _E.PAUSE),
    _row(_E.CLOSE, _F.PAUSE, work=HAS_IT, grip=Grip.FREE),
    _row(_E.CLOSE, grip=Grip.FREE),
    _row(_E.CLOSE, _F.PAUSE, _F.BRAKE, work=HAS_IT),
    _row(_E.CLOSE, _F.BRAKE),
    # what was seen, and lets it stand
    _row(_E.TAKEN, _F.COUNT, queue=Queue.STOPPED),
    _row(
        _E.TAKEN,
        *(_F.COUNT, *TAKE_BACK, _F.LOSE, _F.TELL_TAKEN, _F.PAUSE_TAKEN),
        work=GOES_ON,  # also one that was to run though the queue is paused
    ),
    # it was being stopped: what waits does not drive it off from where somebody takes it
    _row(
        _E.TAKEN,
        *(_F.COUNT, *TAKE_BACK, _F.LOSE, _F.TELL_TAKEN, _F.PAUSE_TAKEN),
        work=Work.WAITS,
        queue=IS_LET_RUN,
        grip=Grip.STOPPING,
    ),
    _row(
        _E.TAKEN,
        *(_F.COUNT, *TAKE_BACK, _F.LOSE, _F.TELL_TAKEN, _F.PAUSE_TAKEN),
        work=HAS_IT,
        queue=IS_LET_RUN,
    ),
    _row(_E.TAKEN, _F.COUNT, *TAKE_BACK, _F.LOSE),
    _row(_E.MODE, _F.WITHDRAW_ARMING, _E.TAKEN),
    # a failsafe's HOLD ends with the next set-point that is under way
    _row(_E.LAPSED, _F.WITHDRAW_ARMING, _E.TAKEN, _F.STAY, has_failsafe=True),
    _row(_E.LAPSED, _F.WITHDRAW_ARMING, _E.TAKEN),
    # since then something was let go: it is a person at the vehicle, or as good as one
    _row(_E.LATE_MODE, _E.MODE, work=(Work.RUNS, Work.LOST)),
    _row(_E.LATE_MODE, grip=(Grip.RELEASING, Grip.STOPPING)),  # HOLD is being asked for
    _row(_E.LATE_MODE, _F.TELL, _F.LET_GO),
    _row(_E.LATE_ARMING, grip=Grip.RELEASING),  # by which it is disarmed, if it was armed for us
    _row(_E.LATE_ARMING, _F.TELL, _F.DISARM, queue=Queue.STOPPED),
    _row(_E.LATE_ARMING, _F.TELL, _F.DISARM, work=Work.NONE),
    _row(_E.LATE_ARMING, _F.TELL, _F.DISARM, _F.PAUSE),  # or it would be armed for what waits
    _row(_E.EXPLAINED, _F.TELL, _F.PAUSE_TAKEN),
    # a request from before the STOP was late; later, it is a person at the vehicle
    _row(_E.MODE_IN_STOP, _F.WITHDRAW_ARMING, _F.BRAKE, is_late=True, grip=Grip.FREE),
    _row(_E.MODE_IN_STOP, _F.WITHDRAW_ARMING),
    _row(_E.DISARMED, _F.WITHDRAW_ARMING, _F.OUTDATE_OUR_ARMING, _F.ZERO_KEPT, _E.TAKEN),
    _row(_E.PARKED, _F.PAUSE_TAKEN, work=(Work.WAITS, *HAS_IT), queue=IS_LET_RUN),
    _row(_E.PARKED),
    # zeros do not stop it, nor can anybody steer it by the stick
    _row(_E.STICK, grip=Grip.FREE),
    _row(_E.STICK, _F.FORGET_RELEASE, grip=(Grip.RELEASING, Grip.STOPPING), work=STANDS),
    _row(_E.STICK, _F.TELL_STICK, _F.NOTE_OTHERS, _F.PAUSE_TAKEN, grip=Grip.STOPPING),
    # it is being stopped for that
    _row(_E.STICK, _F.FORGET_RELEASE, queue=Queue.TAKEN, is_stopping=True, work=STANDS),
    _row(_E.STICK, _F.TELL_STICK, _F.NOTE_OTHERS, _F.PAUSE_TAKEN, _F.STEP, _F.WATCH, brakes=True),
    _row(_E.STICK, _F.TELL_STICK, _F.NOTE_OTHERS, _F.PAUSE_TAKEN, _F.LET_GO, _F.WATCH),
    _row(
        _E.DRIVEN_BY_HAND,
        _F.NOTE_OTHERS,
        _E.STICK,
        heeds_stick=True,
        grip=(*ENGAGED, Grip.STOPPING),
    ),
    _row(_E.DRIVEN_BY_HAND, _F.NOTE_OTHERS, _F.ZERO_KEPT, _E.TAKEN),
    _row(_E.SECOND, _F.TELL, _F.COUNT, _F.NOTE_OTHERS, _E.SECOND, driver=Driver.NOBODY),
    _row(_E.SECOND, _F.NOTE_OTHERS, grip=Grip.STOPPING),
    _row(
        _E.SECOND,
        *(_F.COUNT, *TAKE_BACK, _F.NOTE_OTHERS, _F.ZERO),
        driver=Driver.CLIENT,
        grip=Grip.FREE,
        work=NO_TASK_HAS_IT,
    ),
    _row(_E.SECOND, *TAKE_BACK, _F.NOTE_OTHERS, grip=Grip.FREE, work=NO_TASK_HAS_IT),
    _row(_E.SECOND, _F.NOTE_OTHERS, _E.TAKEN, grip=Grip.FREE),
    _row(_E.SECOND, _F.NOTE_OTHERS, _F.ZERO_AND_HOLD, _E.TAKEN),
    _row(_E.REBOOTED, *TAKE_BACK, _F.TELL, queue=Queue.STOPPED),
    # it may as well be late news of its start: HOLD does no harm to one that has restarted
    _row(
        _E.REBOOTED,
        *(*TAKE_BACK, _F.DO),
        grip=(Grip.RELEASING, Grip.STOPPING),
        work=(Work.NONE, Work.WAITS, Work.STANDS),
    ),
    _row(_E.REBOOTED, *TAKE_BACK, _F.LOSE, _F.DO),
    _row(_E.LATE, _F.LET_GO, _F.LEFT, _F.HOLD_TASK, has_failsafe=True),  # which a zero would end
    _row(_E.LATE, _F.ZERO, _F.LEFT, _F.HOLD_TASK),
    _row(_E.TOO_FAST, _F.TELL, _F.HOLD_TASK, _F.HOLD_AT_ONCE),  # a held stick defeats set-points
    _row(_E.NOT_STANDING, _F.TELL, _F.HOLD_TASK, _F.BRAKE),
    _row(_E.HEARD_AGAIN, _F.BRAKE, grip=Grip.STOPPING),
    _row(_E.HEARD_AGAIN),
    # words that let it go
    _row(_E.CONTINUE, _F.FORGET_GO_TO, _F.DO, _F.RESTORE_ARMING, _F.TELL_HELD, _F.WAKE),
    # what a pause ends, and nobody has said that it may be armed again
    _row(_E.GO_ON, _F.DO, _F.WAKE, queue=Queue.PAUSED),
    _row(_E.GO_ON),
    _row(_E.RELEASE, _F.DO, _F.WAKE),
    _row(_E.RESTORE, _F.DO, _F.RESTORE_ARMING, _F.WAKE),
    _row(_E.RUN_NOW, _F.FORGET_GO_TO, _F.DO, _F.STEP),
    _row(_E.ASK_OUR_MODE, _F.FORGET_START, _F.DO, _F.HAND_OVER),
    _row(
        _E.ASK_OUR_MODE_STREAMING,
        *(_F.FORGET_START, _F.DO, _F.HAND_OVER, _F.ZERO, _F.ZERO),
        grip=Grip.FREE,
        work=NO_TASK_HAS_IT,
    ),
    _row(_E.ASK_OUR_MODE_STREAMING, _F.FORGET_START, _F.DO, _F.HAND_OVER),
    _row(_E.ASK_OTHER_MODE, _F.FORGET_START, _F.DO, _F.HAND_OVER, _E.TAKEN, grip=Grip.TAKING),
    _row(_E.ASK_OTHER_MODE, _F.FORGET_START, _F.DO, _F.HAND_OVER),
    _row(_E.ARM, _F.DO, _F.KEEP_ARMED),
    # what moves nothing by itself
    _row(_E.UNQUEUE, _F.FORGET_GO_TO, _F.FORGET_START, _F.DO),
    _row(_E.CLEAR_WAITING, _F.FORGET_GO_TO, _F.FORGET_START, _F.DO),
    _row(_E.SKIP, _F.DO, _F.REVOKE, _F.WAKE),
    _row(_E.DRIVING_ENDS, driver=(Driver.NOBODY, Driver.OTHERS)),
    _row(_E.DRIVING_ENDS, _F.REVOKE, grip=(*ENGAGED, Grip.STOPPING)),
    _row(_E.DRIVING_ENDS, _F.REVOKE, _F.LET_GO, has_failsafe=True),
    _row(_E.DRIVING_ENDS, _F.REVOKE, _F.ZERO, _F.ZERO),  # one may be lost
    # it stands, and does not wait for its own watch
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
    _row(_E.LEAVE_MANUAL, _F.LET_GO, armed=True, grip=Grip.FREE),
    _row(_E.LEAVE_MANUAL),
    _row(_E.COME_BACK, _F.BRAKE, queue=Queue.STOPPED),
    _row(_E.COME_BACK),
    _row(_E.COME_BACK_DRIVEN, _F.BRAKE, queue=Queue.STOPPED),
    _row(_E.COME_BACK_DRIVEN, queue=Queue.TAKEN, armed=False),  # somebody has it, and it stands
    _row(_E.COME_BACK_DRIVEN, _F.LET_GO),
    _row(_E.COME_BACK_HALTED, _F.BRAKE, queue=Queue.STOPPED),
    _row(_E.COME_BACK_HALTED, _F.LET_GO),
    _row(_E.COME_BACK_LED_AWAY, _F.BRAKE, queue=Queue.STOPPED),
    _row(_E.COME_BACK_LED_AWAY, _F.TELL, has_failsafe=True),  # a zero would have it lose us again
    _row(_E.COME_BACK_LED_AWAY, _F.ZERO),
)

_ROWS = {event: tuple(row for row in TABLE if row.event is event) for event in Event}


def effects_of(event: Event, state: State) -> tuple[Step, ...]:
    """Return what is done about an event, in order."""
    for row in _ROWS[event]:
        if row.fits(state):
            return row.effects
    raise LookupError(f"{event.name} has no row for {state}")
