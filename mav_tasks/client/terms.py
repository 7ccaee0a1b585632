"""What a client may say about when and how a task runs: each declared once, for all calls."""

from datetime import datetime
from typing import Literal, Protocol, TypedDict, cast

#: in place of a rover: the server chooses one
AnyRover = Literal["any"]


class Numbered(Protocol):
    """A task's handle."""

    @property
    def id(self) -> int:
        """The task id."""


class Terms(TypedDict, total=False):
    """The terms of a new task. Times in seconds from now.

    ``priority``: 0 to 10, 10 runs first. ``after``: a task that must complete first. The task
    starts no earlier than in ``delay`` seconds, and expires if it has not started within
    ``deadline`` seconds (0: neither). ``at``: start time, with a time zone. The client repeats
    the submission until it is answered; the server creates one task per ``nonce`` (1 to
    1,065,353,215; 0: a random one). After NoAnswer, submit again with the error's nonce.
    ``label``: a name of up to 24 bytes, shown with the task.

    ``vehicle``: "any" lets the server choose the rover that would begin first. It may choose
    again until the task begins: see ``Task.vehicle``. Places must be global then.

    ``every``: the task repeats, so many seconds from one start to the next (10 to 16,777,215),
    or at the times of a cron expression in UTC, or in the time zone after it: "0 6 * * 1-5
    Europe/Zurich". Then ``deadline`` counts from each start. With an expression there is no
    ``delay`` and no ``at``.
    """

    priority: int
    after: int | Numbered
    delay: float
    deadline: float
    at: datetime | None
    vehicle: int | AnyRover | None
    nonce: int
    label: str
    every: float | str


class Changes(TypedDict, total=False):
    """What can be changed of a task that has not ended; None changes nothing.

    Times in seconds from now. ``preemptible``: other tasks may interrupt it. ``preemptive``: it
    may interrupt other tasks. ``every`` as of a new task; 0: it does not repeat any more.
    ``before``: its place in the queue is just before this task, whatever their priorities; 0:
    behind all.
    """

    priority: int | None
    delay: float | None
    deadline: float | None
    after: int | Numbered | None
    before: int | Numbered | None
    preemptible: bool | None
    preemptive: bool | None
    at: datetime | None
    label: str | None
    every: float | str | None


def id_of(task: int | Numbered) -> int:
    """Return a task's id; what is neither is refused where it is sent."""
    return cast("int", getattr(task, "id", task))
