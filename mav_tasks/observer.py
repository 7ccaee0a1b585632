"""The seam for whoever keeps a record of a run: told all that goes into the engine and out of it.

An observer is called between a packet and its answer: it takes a note, and does its work elsewhere.
It never raises, never waits, and changes nothing.
"""

import logging
from collections.abc import Callable, Sequence
from typing import Protocol

from mav_tasks.engine.inputs import Input, Outgoing
from mav_tasks.tasks.events import Event

log = logging.getLogger("mav_tasks")


class EngineObserver(Protocol):
    """Who is told, in the order in which things happen; ``now`` as the engine was told it."""

    def on_input(self, item: Input | None, *, now: float) -> None:
        """The engine was given an input, or (None) told that a deadline has come."""
        ...

    def on_output(
        self, packets: Sequence[Outgoing], events: Sequence[Event], *, now: float
    ) -> None:
        """The engine gave these; the packets are on their way, the events not yet stored."""
        ...

    def close(self) -> None:
        """The run is over; what is still to be written may be waited for."""
        ...


class EngineObservers:
    """All of them. One that fails is let go: no vehicle stops because a record of it ends."""

    def __init__(self, observers: Sequence[EngineObserver]) -> None:
        self._all = tuple(observers)

    def __repr__(self) -> str:
        return f"EngineObservers({list(self._all)})"

    def on_input(self, item: Input | None, *, now: float) -> None:
        """Tell each what the engine is given."""
        if self._all:
            self._tell(lambda observer: observer.on_input(item, now=now))

    def on_output(
        self, packets: Sequence[Outgoing], events: Sequence[Event], *, now: float
    ) -> None:
        """Tell each what the engine has given."""
        if self._all:
            self._tell(lambda observer: observer.on_output(packets, events, now=now))

    def close(self) -> None:
        """Let each end."""
        self._tell(lambda observer: observer.close())

    def _tell(self, say: Callable[[EngineObserver], None]) -> None:
        for observer in self._all:
            try:
                say(observer)
            except Exception:  # whatever our own mistake is, the vehicle drives on
                log.exception("internal error: %s ends here", observer)
                self._all = tuple(each for each in self._all if each is not observer)
