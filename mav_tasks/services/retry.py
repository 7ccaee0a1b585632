"""Repeating a request until it is answered or too old: arithmetic only."""

from dataclasses import dataclass
from math import inf


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
        """Give it as long as at first, from now on."""
        self.give_up_at += now - self.sent_at

    def next_deadline(self) -> float:
        return min(self.next_at, self.give_up_at)
