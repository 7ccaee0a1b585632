"""A HOLD that may be nobody's wish: some clients send one before each "go to", unseen.

Towards a PX4 MAVSDK does, whenever the mode is another one. The vehicle stands at once all the
same; but its mode is left alone for a while, and a "go to" in that time undoes the pause.
"""

from collections.abc import Hashable
from math import inf

WAITS = 1.0  # s for the "go to"


class HoldBefore:
    """The last HOLD of a client while we drove, for as long as it may be such a one."""

    def __init__(self) -> None:
        self._sender: Hashable = None
        self._until = -inf
        self._has_paused = False
        self._number = 0  # of wishes: which one a promise to undo was about
        #: when the first of those HOLDs came that are one and the same
        self.since = -inf

    def __repr__(self) -> str:
        return f"HoldBefore({self._sender}, until={self._until:.2f})"

    def note(self, sender: Hashable, *, has_paused: bool, now: float) -> None:
        """A client asks for HOLD; ``has_paused``: what was running is paused by this one.

        Repeated by the same client it is one and the same.
        """
        if sender == self._sender and self.is_open(now=now):
            has_paused = has_paused or self._has_paused
        else:
            self.since = now
        self._number += 1
        self._sender, self._has_paused, self._until = sender, has_paused, now + WAITS

    def is_open(self, *, now: float) -> bool:
        """Whether its "go to" may still come."""
        return now < self._until

    def forget(self) -> None:
        """Something else has been wished for since."""
        self._number += 1
        self._until = -inf

    def undoing(self, sender: Hashable, *, now: float) -> int | None:
        """A "go to" of this client is being taken in: it may show that the pause was not meant.

        Gives what ``is_still`` is asked with when it has been; None: it undoes nothing.
        """
        if sender != self._sender or not self.is_open(now=now):
            return None
        self.forget()
        return self._number if self._has_paused else None

    def is_still(self, number: int) -> bool:
        """Whether nothing else has been wished for since."""
        return number == self._number
