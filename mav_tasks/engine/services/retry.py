"""When to send a request again, and when to give it up: arithmetic only.

``Retry`` repeats a request until it is answered or too old. ``Insistence`` is for a vehicle that is
being taken. Each copy of such a request is carried out whenever it comes. One that follows a lost
answer would undo what a person at the vehicle has done since, its switch to MANUAL for example; so
it is repeated only once a heartbeat that came after it shows that nobody has.
"""

from dataclasses import dataclass
from math import inf

UNANSWERED = 0.25  # s after which an answer is held to be lost
ASK_REPEAT = 0.25  # s, between requests that the vehicle refuses
#: times at the least, that one is asked which does not answer: of four, one in 600 is lost four
#: times on a net that loses every fifth packet
TRIES = 4


class Insistence:
    """Says when one request is due again, and when it is given up."""

    def __init__(self) -> None:
        self.until = -inf  #: s, a refusal counts as an answer from then on
        self._again_at: float | None = None
        self._tries = 0
        self._is_refused = False
        self.has_looked = False

    def __repr__(self) -> str:
        return f"Insistence({self._tries} tries, again at {self._again_at})"

    def begin(self, *, until: float) -> None:
        """Nothing is asked yet; what will be, is asked for until then."""
        self.until = until
        self._again_at = None
        self._tries = 0
        self._is_refused = False

    def asked(self, *, now: float) -> None:
        """A request has left."""
        self._tries += 1
        self._again_at = now + UNANSWERED
        self._is_refused = self.has_looked = False

    def accepted(self) -> None:
        """It was accepted: what it asks for shows, or somebody has undone it."""
        self._again_at = None
        self._is_refused = False

    def refused(self, *, now: float) -> None:
        """It was refused, which may pass."""
        self._again_at = now + ASK_REPEAT
        self._is_refused = True

    def is_refusal(self, now: float) -> bool:
        """Whether it was refused, for so long that it is meant."""
        return self._is_refused and now >= self.until

    def is_in_vain(self, now: float) -> bool:
        """Whether it has been asked for often enough of one that does not answer."""
        return self._tries >= TRIES and now >= self.until

    def is_due(self, now: float) -> bool:
        """Whether it is time to look whether to ask again, as long as nobody has acted."""
        return self._again_at is not None and now >= self._again_at


@dataclass(slots=True)
class Retry:
    """When to send again, and when to give up; monotonic seconds."""

    interval: float
    give_up_at: float
    next_at: float
    sent: int = 0
    sent_at: float = -inf

    @classmethod
    def starting(cls, *, now: float, interval: float, give_up_after: float) -> "Retry":
        """Return a retry whose first sending is due at once."""
        return cls(interval=interval, give_up_at=now + give_up_after, next_at=now)

    def is_due(self, now: float) -> bool:
        """Whether it is time to send (again)."""
        return self.next_at <= now < self.give_up_at

    def is_over(self, now: float) -> bool:
        """Whether it is too late for an answer."""
        return now >= self.give_up_at

    def note_sent(self, now: float) -> None:
        """Count a sending and plan the next."""
        self.sent += 1
        self.sent_at = now
        self.next_at = now + self.interval

    def renew(self, now: float) -> None:
        """Start again, with as much time as at first."""
        self.give_up_at += now - self.sent_at

    def next_deadline(self) -> float:
        return min(self.next_at, self.give_up_at)
