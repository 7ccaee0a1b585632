"""What made a vehicle stand last. By it a word that lets go is newer than that, or older.

Each halt raises the epoch, whatever it was: STOP, HOLD, a pause, disarming, a takeover, a loss.
"""

from collections.abc import Hashable
from math import inf
from typing import NamedTuple

from mav_tasks.tasks.events import SERVER
from mav_tasks.tasks.lifecycle import TAKEN, TaskReason, words_of

SAME = 0.2  # s, in which the same halt by the same one is one: five a second of a flood
SENDERS = 32  # whose halts are remembered
SHOWN = 2.0  # s after a disarming in which the vehicle shows that it is disarmed, at 1 Hz

_WORDS = {
    TaskReason.OPERATOR: "a pause",
    TaskReason.STOPPED: "STOP",
    TaskReason.TAKEOVER: "a takeover",
    TaskReason.CANCELLED: "a cancel",
    TaskReason.RESTARTED: "a restart of the server",
    TaskReason.FRAME_RESET: "a change of its position reference",
    TaskReason.DISARMED: "disarming",
}


#: what a client, or the server itself, has said
WORDS = frozenset(
    {
        TaskReason.OPERATOR,
        TaskReason.STOPPED,
        TaskReason.CANCELLED,
        TaskReason.CLEARED,
        TaskReason.DISARMED,
    }
)


class LastHalt(NamedTuple):
    """The last halt of an earlier run."""

    reason: TaskReason
    at: float  # s, of this run's clock


class Halts:
    """The halts of one vehicle: how many there were, and the last."""

    def __init__(self, *, epoch: int = 1) -> None:
        self.epoch = epoch
        self.at = -inf  #: s, when the last came
        self.by: Hashable = None  #: whose word it was; None: nobody's
        self.number = -1  #: of that word, among those of its sender
        self.command = 0  #: of that word, if it is one
        self._numbers: dict[Hashable, int] = {}  # of the last halt of each sender
        self.is_undone = False  #: somebody has let the queue go on since
        self.restored_at = -inf  #: s, when this server began, after another one
        self._reason, self._actor = TaskReason.NONE, ""
        self._was_asked = False  # to go on, since the last
        self._shown_at = -inf  # s, the last disarming that was said before
        self._counted_at = -inf  # s, when the last came that is no other one again

    def __repr__(self) -> str:
        return f"Halts({self.epoch}, {self.words})"

    @property
    def words(self) -> str:
        """The last halt, and who said it."""
        what = _WORDS.get(self._reason) or words_of(self._reason)
        who = self._actor.partition("@")[0]  # the endpoint says nothing to people
        return what if self._actor in ("", SERVER) else f"{what} by {who}"

    @property
    def is_by_word(self) -> bool:
        """Whether the last is somebody's word, and not what was seen of the vehicle."""
        return self._reason in WORDS

    def raise_epoch(self, reason: TaskReason, *, actor: str, now: float) -> bool:
        """Count a halt. Return False if it is the last one again, and is not counted."""
        is_same = (reason, actor) == (self._reason, self._actor)
        if self._reason is TaskReason.DISARMED and reason in TAKEN and now <= self._shown_at:
            self.at = now  # it shows what was said
            return False
        self.at = now  # the last of them, by which words are overtaken
        if is_same and now - self._counted_at < SAME and not self._was_asked:
            return False
        self.epoch += 1
        self._counted_at = now
        self.by, self.number, self.command = None, -1, 0
        self._reason, self._actor, self._was_asked = reason, actor, False
        self.is_undone = False
        return True

    def shows_disarmed(self, *, now: float) -> None:
        """Note that the vehicle shows it is disarmed: that may be what was said just before."""
        if self._reason is TaskReason.DISARMED and now - self.at <= SHOWN:
            self._shown_at = now

    def lets_go(self) -> None:
        """Note that the queue goes on; that does not arm what was disarmed."""
        self.is_undone = self._reason is not TaskReason.DISARMED

    def was_said_by(self, sender: Hashable, number: int, *, command: int = 0) -> None:
        """Note whose word the last halt was, its number among the sender's, and its command.

        A copy of an older one of the same sender, which comes late, is not the last.
        """
        before = self._numbers.pop(sender, -1)
        if number >= before:
            self.command = command
        self.by, self.number = sender, max(number, before)
        self._numbers[sender] = self.number
        if len(self._numbers) > SENDERS:
            del self._numbers[next(iter(self._numbers))]

    def was_asked_to_go_on(self) -> None:
        """Note that a word that lets go has come, whatever became of it."""
        self._was_asked = True
