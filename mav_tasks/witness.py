"""The seam for whoever keeps a record of a run: told all that goes into the engine and out of it.

A witness is called between a packet and its answer: it takes a note, and does its work elsewhere.
It never raises, never waits, and changes nothing.
"""

import logging
from collections.abc import Callable, Sequence
from typing import Protocol

from mav_tasks.engine.inputs import Input, Outgoing
from mav_tasks.tasks.events import Event

log = logging.getLogger("mav_tasks")


class Witness(Protocol):
    """Who is told, in the order in which things happen; ``now`` as the engine was told it."""

    def took_in(self, item: Input | None, *, now: float) -> None:
        """The engine was given an input, or (None) told that a deadline has come."""
        ...

    def gave_out(self, packets: Sequence[Outgoing], events: Sequence[Event], *, now: float) -> None:
        """The engine gave these; the packets are on their way, the events not yet stored."""
        ...

    def close(self) -> None:
        """The run is over; what is still to be written may be waited for."""
        ...


class Witnesses:
    """All of them. One that fails is let go: no vehicle stops because a record of it ends."""

    def __init__(self, witnesses: Sequence[Witness]) -> None:
        self._all = tuple(witnesses)

    def __repr__(self) -> str:
        return f"Witnesses({list(self._all)})"

    def took_in(self, item: Input | None, *, now: float) -> None:
        """Tell each what the engine is given."""
        if self._all:
            self._tell(lambda witness: witness.took_in(item, now=now))

    def gave_out(self, packets: Sequence[Outgoing], events: Sequence[Event], *, now: float) -> None:
        """Tell each what the engine has given."""
        if self._all:
            self._tell(lambda witness: witness.gave_out(packets, events, now=now))

    def close(self) -> None:
        """Let each end."""
        self._tell(lambda witness: witness.close())

    def _tell(self, say: Callable[[Witness], None]) -> None:
        for witness in self._all:
            try:
                say(witness)
            except Exception:  # whatever our own mistake is, the vehicle drives on
                log.exception("internal error: %s ends here", witness)
                self._all = tuple(each for each in self._all if each is not witness)
