"""The states of a task and every transition between them, as one table.

A transition that TRANSITIONS lacks is a bug and raises. A task in a TERMINAL state never changes
again. ``tools/generate`` draws this table into ``mav_tasks/README.md``. The numbers are
those of the dialect's TASK_STATE and TASK_REASON.
"""

from enum import IntEnum

from mav_tasks.basics import errors
from mav_tasks.basics.errors import IllegalTransition


class TaskState(IntEnum):
    """The state of a task."""

    #: the answer for an id that the server does not know
    UNKNOWN = 0
    #: start time not reached
    SCHEDULED = 1
    #: waits for another task, or for a start command
    BLOCKED = 2
    #: ready; waits for its turn and for the vehicle
    QUEUED = 3
    #: taking control of the vehicle: mode, zero setpoint, arm; nothing moves
    STARTING = 4
    #: the only state in which the vehicle is driven
    EXECUTING = 5
    #: interrupted; keeps its exact remainder, and resumes through STARTING
    PAUSED = 6
    #: zero velocity was sent, standstill not yet measured
    CANCELLING = 7
    #: needs a decision (again, remainder, skip); blocks its vehicle's queue
    HELD = 8
    COMPLETED = 9
    FAILED = 10
    CANCELLED = 11
    #: ended by STOP or by a kill
    KILLED = 12
    #: its deadline passed before it started
    EXPIRED = 13


class TaskReason(IntEnum):
    """Why a task waits, is interrupted, ended, or was refused."""

    NONE = 0
    # waiting
    START_TIME = 1
    DEPENDENCY = 2
    BEHIND_OTHERS = 3
    QUEUE_PAUSED = 4
    WAITING_FOR_START = 5
    DISARMED = 6
    WRONG_MODE = 7
    NO_POSITION = 8
    VEHICLE_SILENT = 9
    OTHER_CONTROLLER = 10
    HELD_AHEAD = 11
    RESTARTED = 12
    NOT_READY = 13
    LOSS_FAILSAFE = 14
    OUTSIDE_OWN_FENCE = 15
    # paused
    OPERATOR = 30
    PREEMPTED = 31
    TAKEOVER = 32
    LINK_LOST = 33
    POSITION_LOST = 34
    STOPPED = 35
    FAILSAFE = 36
    LEASE_LOST = 37
    # held
    OUTCOME_UNKNOWN = 50
    FENCE = 51
    LATE = 52
    OFF_TRACK = 53
    FRAME_RESET = 54
    STOP_UNCONFIRMED = 55
    OVERSPEED = 56
    # ended
    STUCK = 70
    ARM_REFUSED = 71
    MODE_REFUSED = 72
    START_TIMEOUT = 73
    LINK_TIMEOUT = 74
    DEPENDENCY_FAILED = 75
    DEADLINE = 76
    CANCELLED = 77
    CLEARED = 78
    REPLACED = 79
    STOP = 80
    SKIPPED = 81
    REFUSED = 82
    NO_ANSWER = 83
    # refused
    QUEUE_FULL = 100
    QUOTA = 101
    STORE_UNAVAILABLE = 102
    BAD_PARAMETER = errors.BAD_PARAMETER
    BAD_FRAME = errors.BAD_FRAME
    OUTSIDE_FENCE = 105
    NOT_SUPPORTED_BY_VEHICLE = 106
    NOT_FOUND = 107
    NOT_ALLOWED = 108
    UNKNOWN_DEPENDENCY = 109
    CYCLE = 110
    NONCE_REUSED = 111
    WRONG_STATE = 112
    RATE_LIMITED = 113
    STALE = 114


#: a task is paused because a person, another program or the rover's own failsafe drives the rover
TAKEN = frozenset({TaskReason.TAKEOVER, TaskReason.FAILSAFE})
#: a task paused by one of these resumes by itself when the loss is over
LOSSES = frozenset({TaskReason.LINK_LOST, TaskReason.POSITION_LOST, TaskReason.LEASE_LOST})

_WORDS = {
    **{reason: reason.name.lower().replace("_", " ") for reason in TaskReason},
    # reasons whose name is not what people say
    TaskReason.BEHIND_OTHERS: "behind other tasks",
    TaskReason.WAITING_FOR_START: "needs a start command",
    TaskReason.VEHICLE_SILENT: "rover silent",
    TaskReason.LINK_LOST: "rover silent",
    TaskReason.OTHER_CONTROLLER: "another controller drives",
    TaskReason.HELD_AHEAD: "behind a held task",
    TaskReason.RESTARTED: "after a restart",
    TaskReason.OUTSIDE_OWN_FENCE: "outside the rover's own fence",
    TaskReason.STOPPED: "STOP",
    TaskReason.FAILSAFE: "rover's failsafe",
    TaskReason.LEASE_LOST: "the gateway does not reach the fleet's database",
    TaskReason.OUTCOME_UNKNOWN: "interrupted, progress unknown",
    TaskReason.FENCE: "stopped at the fence",
    TaskReason.LATE: "server was late",
    TaskReason.FRAME_RESET: "position reference changed",
    TaskReason.STOP_UNCONFIRMED: "standstill not confirmed",
    TaskReason.REPLACED: "replaced by a newer task",
    TaskReason.REFUSED: "the rover refused the command",
    TaskReason.NO_ANSWER: "no answer to the command, which may have been done",
    TaskReason.STOP: "STOP",
}

STOP_IN_FORCE = "STOP is in force"
CONTINUE_FIRST = f"{STOP_IN_FORCE}: press Continue first"


def words_of(reason: TaskReason) -> str:
    """Return a reason as text for people."""
    return _WORDS[reason]


_S = TaskState

#: from -> to -> who moves the task along this edge, and why
TRANSITIONS: dict[TaskState, dict[TaskState, str]] = {
    _S.SCHEDULED: {
        _S.BLOCKED: "start time reached, waits for a task",
        _S.QUEUED: "start time reached",
        _S.CANCELLED: "client",
        _S.EXPIRED: "deadline",
        _S.FAILED: "dependency failed",
        _S.KILLED: "kill",
    },
    _S.BLOCKED: {
        _S.SCHEDULED: "start time set",
        _S.QUEUED: "dependency done, or start command",
        _S.CANCELLED: "client",
        _S.EXPIRED: "deadline",
        _S.FAILED: "dependency failed",
        _S.KILLED: "kill",
    },
    _S.QUEUED: {
        _S.SCHEDULED: "start time set",
        _S.BLOCKED: "dependency set",
        _S.STARTING: "its turn",
        _S.CANCELLED: "client",
        _S.EXPIRED: "deadline",
        _S.FAILED: "dependency failed",
        _S.KILLED: "kill",
    },
    _S.STARTING: {
        _S.EXECUTING: "in our mode and seen armed",
        _S.PAUSED: "operator, takeover, link, position or lease lost",
        _S.CANCELLING: "client",
        _S.FAILED: "mode or arm refused",
        _S.HELD: "off track, position reference changed, server crashed",
        _S.KILLED: "STOP or kill",
    },
    _S.EXECUTING: {
        _S.COMPLETED: "arrived and standing still",
        _S.PAUSED: "operator, pre-empted, takeover, link, position or lease lost",
        _S.CANCELLING: "client",
        _S.FAILED: "stuck",
        _S.HELD: "off track, fence, overspeed, not standing, position reference changed,"
        " server late, server crashed",
        _S.KILLED: "STOP or kill",
    },
    _S.PAUSED: {
        _S.STARTING: "resumed",
        _S.CANCELLING: "client",
        _S.FAILED: "time-out",
        _S.HELD: "off track, position reference changed",
        _S.KILLED: "STOP or kill",
    },
    _S.CANCELLING: {
        _S.CANCELLED: "standing still",
        _S.HELD: "standstill not confirmed, server crashed",
        _S.KILLED: "STOP or kill",
    },
    _S.HELD: {
        _S.STARTING: "released",
        _S.CANCELLED: "skipped",
        _S.KILLED: "STOP or kill",
    },
}

#: the states in which a task can be created
INITIAL = frozenset({_S.SCHEDULED, _S.BLOCKED, _S.QUEUED})
#: final: a task never leaves these
TERMINAL = frozenset({_S.COMPLETED, _S.FAILED, _S.CANCELLED, _S.KILLED, _S.EXPIRED})
#: not started
WAITING = INITIAL
#: has the vehicle: at most one such task per vehicle
RUNNING = frozenset({_S.STARTING, _S.EXECUTING, _S.CANCELLING})
#: started and not over: several per vehicle if tasks are suspended
ACTIVE = frozenset({_S.STARTING, _S.EXECUTING, _S.PAUSED, _S.CANCELLING, _S.HELD})


def check_transition(old: TaskState, new: TaskState) -> None:
    """Raise IllegalTransition unless the table has the edge ``old`` → ``new``."""
    if new not in TRANSITIONS.get(old, {}):
        raise IllegalTransition(f"no transition {old.name} -> {new.name}")
