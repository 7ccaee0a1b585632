"""What clients wish, and the server has not answered yet, of what may end a STOP or a takeover.

Several wishes may be read in one step, from several clients; their answers come later, in order.
"""

from typing import NamedTuple

UNANSWERED = 1.0  # s; a wish of which nothing was heard by then is answered by nobody


class Latches(NamedTuple):
    """What keeps the server from driving."""

    stopped: bool
    taken_over: bool


class Wish(NamedTuple):
    """A command that a client has sent, and what it ends if it is granted."""

    command: int
    ends_stop: bool
    ends_takeover: bool


class Wishes:
    """Remembers what is in force if those that are still open are refused."""

    def __init__(self) -> None:
        self._open: list[Wish] = []
        self._at = 0.0
        self._left = Latches(stopped=False, taken_over=False)

    def __repr__(self) -> str:
        return f"Wishes({self._open}, {self._left})"

    def asked(self, now: float, wish: Wish, latches: Latches) -> Latches:
        """A wish is read while these are in force; gives what is, if it is granted."""
        if not self._open or now - self._at > UNANSWERED:
            self._open, self._left = [], latches
        self._open.append(wish)
        self._at = now
        return _without(latches, wish)

    def taken_over_no_more(self) -> None:
        """Something that is not refused has ended a takeover."""
        self._left = self._left._replace(taken_over=False)

    def stopped(self) -> None:
        """STOP comes after all that was asked before."""
        self._open.clear()

    def answered(self, command: int, *, is_granted: bool) -> Latches | None:
        """One is answered; gives what is in force, once it was the last one."""
        wish = next((each for each in self._open if each.command == command), None)
        if wish is None:
            return None
        self._open.remove(wish)
        if is_granted:
            self._left = _without(self._left, wish)
        return None if self._open else self._left


def _without(latches: Latches, wish: Wish) -> Latches:
    return Latches(
        stopped=latches.stopped and not wish.ends_stop,
        taken_over=latches.taken_over and not wish.ends_takeover,
    )
