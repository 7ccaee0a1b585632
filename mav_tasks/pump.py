"""Engine, store and links, turned by whoever knows the time. It decides nothing.

What must be durable first the engine holds back by itself: whatever ``take_packets`` gives may
leave at once, and so it leaves before the events of the same turn reach the store.
"""

import logging
from collections.abc import Callable, Sequence
from contextlib import suppress

from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import Committed, HaltNotStored, Input, Outgoing, StoreFailed
from mav_tasks.logs.rendering import level_of
from mav_tasks.observer import EngineObserver, EngineObservers
from mav_tasks.store import HaltNotKept, Kept, NotKept, Outcome, Store
from mav_tasks.tasks.events import Event, ServerStopped

log = logging.getLogger("mav_tasks")


class Pump:
    """Engine, store and links, turned by whoever knows the time."""

    def __init__(
        self,
        engine: Engine,
        store: Store,
        send: Callable[[Outgoing], None],
        *,
        observers: Sequence[EngineObserver] = (),
    ) -> None:
        self.engine = engine
        self._store = store
        self._send = send
        self._observers = EngineObservers(observers)
        self._store_is_away = False
        self.is_over = False

    def handle(self, item: Input, *, now: float) -> None:
        """Take one input in; ``turn`` brings out what follows."""
        self._observers.on_input(item, now=now)
        self.engine.handle(item, now=now)

    def handle_deadline(self, *, now: float) -> None:
        """Do what the time asks for; ``turn`` brings out what follows."""
        self._observers.on_input(None, now=now)
        self.engine.handle_deadline(now=now)

    def turn(self, *, now: float) -> None:
        """Send and store until nothing is left to do."""
        noted: list[Event] = []
        while True:
            packets = self.engine.take_packets()
            for outgoing in packets:
                self._send(outgoing)
            events = self.engine.take_events()
            if packets or events:
                self._observers.on_output(packets, events, now=now)
            if events:
                self._store.append(events)
                noted += events
            outcomes = self._store.take_outcomes()
            if not outcomes:
                break
            for outcome in outcomes:
                self._note_outcome(outcome)
                self.handle(_input_of(outcome), now=now)
        self._note(noted)  # last: whoever waits for an answer does not wait for the log

    def close(self) -> None:
        """Let the observers end."""
        self._observers.close()

    def send_last_words(self) -> None:
        """Stop every vehicle that is being driven; of the engine it needs its signature at most."""
        for outgoing in self.engine.emergency_stop_packets:
            sealed = outgoing
            with suppress(Exception):  # a rover that asks for no signature takes it without one
                sealed = self.engine.signatures.sealed_late(outgoing)
            with suppress(Exception):  # what fails for one must not keep it from the next
                self._send(sealed)

    def _note_outcome(self, outcome: Outcome) -> None:
        match outcome:
            case HaltNotKept(text=text):
                log.error("%s", text)
                return
            case NotKept(text=text):
                log.error("%s: submissions are refused until it is mended", text)
            case Kept() if self._store_is_away:
                log.warning("the store takes events again")
        self._store_is_away = isinstance(outcome, NotKept)

    def _note(self, events: list[Event]) -> None:
        for event in events:
            log.log(level_of(event), event)
            if isinstance(event, ServerStopped):
                self.is_over = True


def _input_of(outcome: Outcome) -> Input:
    match outcome:
        case Kept(through=through):
            return Committed(through)
        case NotKept(text=text):
            return StoreFailed(text)
        case HaltNotKept(vehicle=vehicle):
            return HaltNotStored(vehicle)
