"""A HOLD that nobody may have meant: some clients silently send one before each "go to".

MAVSDK does so to a PX4 whenever the mode is another one. The vehicle still stops at once. But its
mode is left alone for a while, and a "go to" in that time undoes the pause.
"""

from collections.abc import Hashable
from math import inf

from mav_tasks.tasks.halts import Halts

WAITS = 1.0  # s in which the "go to" must come


class HoldBefore:
    """The last HOLD of a client while we drove, while a "go to" may still undo it."""

    def __init__(self, halts: Halts) -> None:
        self._halts = halts
        self._term = -1  # in which the last one came
        self._sender: Hashable = None
        self._until = -inf
        self._has_paused = False
        self._number = 0  # counts requests, to tell which one a pending undo is about
        #: when the first of a client's repeated HOLDs came
        self.since = -inf

    def __repr__(self) -> str:
        return f"HoldBefore({self._sender}, until={self._until:.2f})"

    def note(self, sender: Hashable, *, has_paused: bool, now: float) -> None:
        """Note a client's HOLD, which is a halt; ``has_paused``: it paused what was running.

        Repetitions by the same client count as one HOLD, if nothing else came between.
        """
        is_next = self._term == self._halts.term - 1
        if sender == self._sender and is_next and now < self._until:
            has_paused = has_paused or self._has_paused
        else:
            self.since = now
        self._number += 1
        self._term = self._halts.term
        self._sender, self._has_paused, self._until = sender, has_paused, now + WAITS

    def is_open(self, *, now: float) -> bool:
        """Return whether its "go to" may still come."""
        return now < self._until and self._term == self._halts.term

    def forget(self) -> None:
        """Note another request: a "go to" undoes this HOLD no more."""
        self._number += 1
        self._until = -inf

    def undoing(self, sender: Hashable, *, now: float) -> int | None:
        """Return a number if a client's "go to" shows that the pause was not meant, else None.

        Pass the number to ``is_still`` once the "go to" is durable.
        """
        if sender != self._sender or not self.is_open(now=now):
            return None
        self.forget()
        return self._number if self._has_paused else None

    def is_still(self, number: int) -> bool:
        """Return whether no other request has come since ``undoing`` returned this number."""
        return number == self._number and self._term == self._halts.term
