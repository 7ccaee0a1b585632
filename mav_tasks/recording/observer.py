"""The observer interface: recorders and logs see every engine input and output.

An observer is called between a packet and its answer, so it only queues what it saw and does its
work elsewhere. It never raises, never blocks, and changes nothing.
"""

import logging
from collections.abc import Callable, Sequence
from typing import Protocol

from mav_tasks.engine.inputs import Input, Outgoing
from mav_tasks.tasks.events import Event

log = logging.getLogger("mav_tasks")


class EngineObserver(Protocol):
    """Sees inputs and outputs in the order in which they happen; ``now`` is the engine's."""

    def on_input(self, item: Input | None, *, now: float) -> None:
        """Note an input that the engine is about to handle; None is a deadline."""

    def on_output(
        self, packets: Sequence[Outgoing], events: Sequence[Event], *, now: float
    ) -> None:
        """Note the engine's output; the packets were sent, the events are not yet stored."""

    def close(self) -> None:
        """End the record; this call may wait until everything is written."""


class EngineObservers:
    """All observers. One that raises is removed, so that no vehicle stops because of a record."""

    def __init__(self, observers: Sequence[EngineObserver]) -> None:
        self._all = tuple(observers)

    def __repr__(self) -> str:
        return f"EngineObservers({list(self._all)})"

    def on_input(self, item: Input | None, *, now: float) -> None:
        if self._all:
            self._tell(lambda observer: observer.on_input(item, now=now))

    def on_output(
        self, packets: Sequence[Outgoing], events: Sequence[Event], *, now: float
    ) -> None:
        if self._all:
            self._tell(lambda observer: observer.on_output(packets, events, now=now))

    def close(self) -> None:
        self._tell(lambda observer: observer.close())

    def _tell(self, say: Callable[[EngineObserver], None]) -> None:
        for observer in self._all:
            try:
                say(observer)
            except Exception:  # a bug in an observer must not stop the vehicle
                log.exception("internal error: %s is switched off", observer)
                self._all = tuple(each for each in self._all if each is not observer)
