"""The halts of a vehicle, by which a permission, or a request to resume, is newer or older.

Each halt raises the epoch, whatever its cause: STOP, HOLD, a pause, disarming, a takeover, a loss.
Equal ones in short order raise it once. ``term`` counts all of them: whatever may move the vehicle
later is a ``Permit``, which remembers the term in which it was given and counts in that term only.
"""

from collections.abc import Hashable
from math import inf
from typing import Generic, NamedTuple, TypeVar

from mav_tasks.basics.latest import keep_latest
from mav_tasks.tasks.events import SERVER
from mav_tasks.tasks.lifecycle import TaskReason, words_of

SAME = 0.2  # s, in which equal halts of one actor count once: a flood counts five a second
SENDERS = 32  # whose last halts are remembered

_WORDS = {
    TaskReason.OPERATOR: "a pause",
    TaskReason.STOPPED: "STOP",
    TaskReason.TAKEOVER: "a takeover",
    TaskReason.CANCELLED: "a cancel",
    TaskReason.CLEARED: "a clear",
    TaskReason.RESTARTED: "a restart",
    TaskReason.FRAME_RESET: "a change of its position reference",
    TaskReason.DISARMED: "disarming",
}


#: halts by a command of a client or of the server itself
WORDS = frozenset(
    {
        TaskReason.OPERATOR,
        TaskReason.STOPPED,
        TaskReason.CANCELLED,
        TaskReason.CLEARED,
        TaskReason.DISARMED,
    }
)


#: halts by somebody: a command, or what a person or another controller does to the vehicle
BY_SOMEBODY = WORDS | {TaskReason.TAKEOVER, TaskReason.OTHER_CONTROLLER}
#: why a vehicle pauses its queue by itself: it cannot do what it is given
DISABLED = frozenset(
    {
        TaskReason.FAILSAFE,
        TaskReason.STUCK,
        TaskReason.ARM_REFUSED,
        TaskReason.MODE_REFUSED,
        TaskReason.START_TIMEOUT,
        TaskReason.LINK_TIMEOUT,
    }
)


class LastHalt(NamedTuple):
    """The last halt of a vehicle by somebody."""

    reason: TaskReason
    at: float  # s, of this run's clock


NOBODY = LastHalt(TaskReason.NONE, -inf)


class Halts:
    """Counter of one vehicle's halts, with the last one."""

    def __init__(self) -> None:
        self.epoch = 1
        self.term = 0
        #: the last one by somebody, until somebody lets the vehicle go on
        self.by_somebody = NOBODY
        self.at = -inf  #: s, when the last one came
        self.by: Hashable = None  #: sender of the command; None: no command
        #: sender of the last halt, if that holds the vehicle; its cancels and clears change nothing
        self.held_by: Hashable = None
        self.number = -1  #: of that command, in its sender's sequence
        self.command = 0  #: MAV_CMD of that command, if it is one
        self._numbers: dict[Hashable, int] = {}  # of the last halt of each sender
        self.is_undone = False  #: the queue was resumed since
        self.restored_at = -inf  #: s, when this run loaded an earlier one
        self._reason, self._actor = TaskReason.NONE, ""
        self.was_asked = False  #: to resume, since the last halt, whether that was accepted or not
        self._counted_at = -inf  # s, when the last halt came that counted

    def __repr__(self) -> str:
        return f"Halts({self.epoch}, {self.words})"

    @property
    def words(self) -> str:
        """The last halt and its actor as text."""
        what = _WORDS.get(self._reason) or words_of(self._reason)
        who = self._actor.partition("@")[0]  # the endpoint means nothing to people
        return what if self._actor in ("", SERVER) else f"{what} by {who}"

    @property
    def is_by_word(self) -> bool:
        """Whether the last halt was a command, and not seen in the vehicle's telemetry."""
        return self._reason in WORDS

    def restore(self, epoch: int, by_somebody: LastHalt, *, now: float) -> None:
        """Go on after the halts of an earlier run."""
        self.epoch, self.by_somebody, self.restored_at = epoch, by_somebody, now

    def raise_epoch(self, reason: TaskReason, *, actor: str, now: float) -> bool:
        """Count a halt. Return False if it repeats the last one and does not count."""
        self.term += 1
        if reason in BY_SOMEBODY:
            is_word = self.by_somebody.reason in WORDS and reason not in WORDS
            self.by_somebody = LastHalt(self.by_somebody.reason if is_word else reason, now)
        self.at = now  # a repeated halt, too, makes older commands stale
        is_same = (reason, actor) == (self._reason, self._actor)
        if is_same and now - self._counted_at < SAME and not self.was_asked:
            return False
        self.epoch += 1
        self._counted_at = now
        self.by, self.number, self.command = None, -1, 0
        if reason not in (TaskReason.CANCELLED, TaskReason.CLEARED):
            self.held_by = None
        self._reason, self._actor, self.was_asked = reason, actor, False
        self.is_undone = False
        return True

    def lets_go(self) -> None:
        """Note that the queue was resumed; that does not undo a disarming."""
        self.is_undone = self._reason is not TaskReason.DISARMED
        self.by_somebody = NOBODY

    def was_said_by(
        self, sender: Hashable, number: int, *, command: int = 0, holds: bool = True
    ) -> None:
        """Note the sender of the last halt, its command, and the number of that command.

        ``holds``: it holds the vehicle, as a cancel does not: who has said no more than that may
        not let it go.
        A late copy of an older halt of the same sender does not replace the last one.
        """
        before = self._numbers.get(sender, -1)
        if number >= before:
            self.command = command
        self.by, self.number = sender, max(number, before)
        if holds:
            self.held_by = sender
        elif self.held_by is not sender:
            self.held_by = None
        keep_latest(self._numbers, sender, self.number, most=SENDERS)


T = TypeVar("T")


class Permit(Generic[T]):
    """A permit for one vehicle. Its holder is the client that has it, or what is permitted."""

    def __init__(self, halts: Halts) -> None:
        self._halts = halts
        #: who got it last; None after ``end``. Only ``holder`` says whether it has ended by itself
        self.given: T | None = None
        self._term, self._until = -1, -inf

    def __repr__(self) -> str:
        return f"Permit({self.given}, until={self._until:.2f})"

    def give(self, holder: T, *, until: float = inf) -> None:
        """Let a holder have the permit; this replaces the previous holder."""
        self.given, self._term, self._until = holder, self._halts.term, until

    def end(self) -> None:
        """End the permit, because something else was requested since."""
        self.given = None

    def holder(self, *, now: float = inf, halts: int = 0) -> T | None:
        """Return the holder, or None if the permit has ended.

        ``now`` may be left out for a permit that no time ends. ``halts``: return the holder of a
        permit that was given exactly so many halts ago.
        """
        is_in_time = now < self._until or self._until == inf
        return self.given if is_in_time and self._term + halts == self._halts.term else None
