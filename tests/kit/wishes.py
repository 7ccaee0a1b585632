"""Requests of clients, not answered yet, that may end a STOP or a takeover.

Several requests of several clients may be read in one step; their answers come later, in order.
"""

from typing import NamedTuple

UNANSWERED = 1.0  # s; without an answer by then, a request is never answered


class Latches(NamedTuple):
    """The latches that keep the server from driving."""

    stopped: bool
    taken_over: bool


class Wish(NamedTuple):
    """A client's command, and the latches that it ends if granted."""

    command: int
    ends_stop: bool
    ends_takeover: bool


class Wishes:
    """Keeps the latches that remain if the open requests are refused."""

    def __init__(self) -> None:
        self._open: list[Wish] = []
        self._at = 0.0
        self._left = Latches(stopped=False, taken_over=False)

    def __repr__(self) -> str:
        return f"Wishes({self._open}, {self._left})"

    def asked(self, now: float, wish: Wish, latches: Latches) -> Latches:
        """Add a request read under these latches; return the latches if it is granted."""
        if not self._open or now - self._at > UNANSWERED:
            self._open, self._left = [], latches
        self._open.append(wish)
        self._at = now
        return _without(latches, wish)

    def taken_over_no_more(self) -> None:
        """Note that an event that cannot be refused has ended a takeover."""
        self._left = self._left._replace(taken_over=False)

    def stopped(self) -> None:
        """Note a STOP, which overrides all earlier requests."""
        self._open.clear()

    def answered(self, command: int, *, is_granted: bool) -> Latches | None:
        """Note an answer; return the latches once no request is open."""
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
