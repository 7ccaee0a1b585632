"""What a client may say about when and how a task runs: each term is declared once, here.

From them come the arguments of the library, the options of the command line, and the parts of
requests over HTTP and of agents. Pure.
"""

from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Any, Literal, Protocol, TypedDict, cast, get_type_hints

from mav_tasks.basics.errors import SettingError
from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.shapes import Flag, Number, Text
from mav_tasks.mavlink.enums import TaskProperty
from mav_tasks.mavlink.label import MAX_LABEL
from mav_tasks.tasks.repetition import MAX_PERIOD, MAX_REPEAT, MIN_PERIOD
from mav_tasks.tasks.task import DEFAULT_PRIORITY, MAX_DELAY, MAX_PRIORITY, MAX_TASK_ID

#: in place of a rover: the server chooses one
AnyRover = Literal["any"]

WAIT = Number(0, MAX_DELAY, "s")
TASK_OR_NONE = Number(0, MAX_TASK_ID, is_whole=True)


class Numbered(Protocol):
    """A task's handle."""

    @property
    def id(self) -> int:
        """The task id."""


class CommonTerms(TypedDict, total=False):
    """What can be said of a new task, and changed until it has ended; None: not given.

    ``priority``: 0 to 10, 10 runs first. ``after``: a task that must complete first; 0: none.
    Times in seconds from now: the task starts no earlier than in ``delay`` seconds, and expires if
    it has not started within ``deadline`` seconds (0: neither). ``at``: start time, with a time
    zone. ``label``: a name of up to 24 bytes, shown with the task.

    ``every``: the task repeats, so many seconds from one start to the next (10 to 16,777,215; 0:
    it does not), or at the times of a cron expression in UTC, or in the time zone after it: "0 6 *
    * 1-5 Europe/Zurich". Then ``deadline`` counts from each start. With an expression there is no
    ``delay`` and no ``at``.
    """

    priority: Annotated[
        int | None,
        Number(0, MAX_PRIORITY, is_whole=True),
        f"{MAX_PRIORITY} runs first; a new task has {DEFAULT_PRIORITY}",
        TaskProperty.PRIORITY,
    ]
    after: Annotated[
        int | Numbered | None,
        TASK_OR_NONE,
        "task that must complete first; 0: none",
        TaskProperty.RUN_AFTER,
    ]
    delay: Annotated[
        float | None, WAIT, "earliest start, from now; 0: none", TaskProperty.START_DELAY
    ]
    at: Annotated[
        datetime | None,
        Text("a time", least=1, most=40),
        "start time, ISO 8601 with a time zone",
        TaskProperty.START_UTC,
    ]
    deadline: Annotated[
        float | None,
        WAIT,
        "the task expires if it has not started so long from now, or after each start time if it"
        " repeats; 0: none",
        TaskProperty.DEADLINE,
    ]
    label: Annotated[
        str | None,
        Text("a name", most=MAX_LABEL),
        f"name of the task, at most {MAX_LABEL} bytes of UTF-8; empty: none",
        TaskProperty.LABEL,
    ]
    every: Annotated[
        float | str | None,
        Number(0, MAX_PERIOD, "s", is_whole=True),
        f"repeat: from one start to the next, {MIN_PERIOD} or more; 0: do not",
        TaskProperty.EVERY,
    ]


class Terms(CommonTerms, total=False):
    """The terms of a new task: those of ``CommonTerms``, and how it is submitted.

    ``vehicle``: "any" lets the server choose the rover that would begin first. It may choose
    again until the task begins: see ``Task.vehicle``. Places must be global then.

    The client repeats the submission until it is answered; the server creates one task per
    ``nonce`` (1 to 1,065,353,215; 0: a random one). After NoAnswer, submit again with the error's
    nonce.
    """

    vehicle: int | AnyRover | None
    nonce: int


class Changes(CommonTerms, total=False):
    """What can be changed of a task that has not ended: the terms of ``CommonTerms``, and these.

    A submission does not carry them, and the server may refuse them: it would have the task then.

    ``before``: its place in the queue is just before this task, whatever their priorities; 0:
    behind all. ``preemptible``: other tasks may interrupt it. ``preemptive``: it may interrupt
    other tasks.
    """

    before: Annotated[
        int | Numbered | None,
        TASK_OR_NONE,
        "it runs just before this task; 0: last",
        TaskProperty.RUN_BEFORE,
    ]
    preemptible: Annotated[
        bool | None, Flag(), "other tasks may interrupt it", TaskProperty.PREEMPTIBLE
    ]
    preemptive: Annotated[
        bool | None, Flag(), "it may interrupt other tasks", TaskProperty.PREEMPTIVE
    ]


_DECLARED = {
    name: hint.__metadata__ for name, hint in get_type_hints(Changes, include_extras=True).items()
}
#: the property of TASK_MODIFY that changes each term
PROPERTIES: dict[str, TaskProperty] = {name: each[2] for name, each in _DECLARED.items()}
#: terms whose values are sent otherwise than as one number
NOT_NUMBERS = ("at", "label", "every")
#: each term as a part of a request: to change a task, and for a new one
OF_CHANGES = {name: Part(name, *declared[:2]) for name, declared in _DECLARED.items()}
OF_NEW = {name: OF_CHANGES[name] for name in get_type_hints(CommonTerms)}
#: the other form of ``every`` in a request
CRON = Part(
    "cron",
    Text("a cron expression", most=MAX_REPEAT),
    "repeat: minute, hour, day of month, month, day of week, and perhaps a time zone, else UTC;"
    " empty: do not",
)
#: all parts of these requests
NEW = (*OF_NEW.values(), CRON)
CHANGES = (*NEW, *(part for name, part in OF_CHANGES.items() if name not in OF_NEW))


def given(terms: CommonTerms | Changes, known: Mapping[str, Part]) -> dict[str, Any]:
    """Return the terms that are given. Raise TypeError if one is not known."""
    if unknown := terms.keys() - known:
        raise TypeError(f"unknown: {', '.join(sorted(unknown))}; expected {', '.join(known)}")
    return {name: value for name, value in terms.items() if value is not None}


def requested(values: Mapping[str, Any]) -> CommonTerms:
    """Return the terms in the parts of a request. Raise SettingError if they are invalid."""
    terms = {name: values[name] for name in OF_CHANGES if values.get(name) is not None}
    if "at" in terms:
        terms["at"] = _moment_of(terms["at"])
    if (cron := values.get("cron")) is not None:
        if cron and terms.get("every"):
            raise SettingError("every and cron: choose one of them")
        terms["every"] = cron or terms.get("every", 0)
    return cast("CommonTerms", terms)


def _moment_of(text: str) -> datetime:
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        words = "expected a time such as 2026-11-20T14:30:00Z"
        raise SettingError(f"at {text!r}: {words}") from None
    if moment.tzinfo is None:
        raise SettingError(f"at {text!r}: expected a time zone, such as Z or +01:00")
    return moment


def id_of(task: int | Numbered) -> int:
    """Return a task's id; what is neither is refused where it is sent."""
    return cast("int", getattr(task, "id", task))
