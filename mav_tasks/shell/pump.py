"""Moves data between engine, store and links, in the caller's time. It decides nothing.

The engine itself holds back packets that must wait for the store. Packets from ``take_packets`` may
therefore be sent at once, before the events of the same turn reach the store.
"""

import logging
from collections.abc import Callable, Sequence
from contextlib import suppress

from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import Committed, HaltNotStored, Input, Outgoing, StoreFailed
from mav_tasks.recording.observer import EngineObserver, EngineObservers
from mav_tasks.store import Evicted, Outcome, Store
from mav_tasks.store.rendering import level_of
from mav_tasks.tasks.events import Event, ServerStopped

log = logging.getLogger("mav_tasks")


class Pump:
    """One turn of the server: an input goes in, packets go to the links, events to the store."""

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
        #: whether another gateway may have the vehicles: nothing may be sent any more
        self.is_evicted = False

    def handle(self, item: Input, *, now: float) -> None:
        """Pass one input to the engine; ``turn`` sends and stores the results."""
        self._observers.on_input(item, now=now)
        self.engine.handle(item, now=now)

    def handle_deadline(self, *, now: float) -> None:
        """Let the engine handle a due deadline; ``turn`` sends and stores the results."""
        self._observers.on_input(None, now=now)
        self.engine.handle_deadline(now=now)

    def turn(self, *, now: float) -> None:
        """Send packets and store events until the store has no more outcomes to report."""
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
                item = self._input_of(outcome)
                if item is not None:
                    self.handle(item, now=now)
        self._note(noted)  # last, so that no answer waits for the log

    def close(self) -> None:
        self._observers.close()

    def send_last_words(self) -> None:
        """Send the prepared packets that stop each driven vehicle; the engine only signs them."""
        for outgoing in self.engine.emergency_stop_packets:
            sealed = outgoing
            with suppress(Exception):  # a rover without signing takes it unsigned
                sealed = self.engine.signatures.sealed_late(outgoing)
            with suppress(Exception):  # one failure must not keep the others from stopping
                self._send(sealed._replace(until=self.engine.stop_until))

    def _input_of(self, outcome: Outcome) -> Input | None:
        """Return the engine's input for an outcome of the store; log a failure and its end."""
        match outcome:
            case Evicted(text=text):
                log.error("%s", text)
                self.is_evicted = True
                return None
            case HaltNotStored(text=text):
                log.error("%s", text)
            case StoreFailed(text=text):
                log.error("%s: new tasks are refused until the store works", text)
                self._store_is_away = True
            case Committed() if self._store_is_away:
                log.warning("the store works again")
                self._store_is_away = False
        return outcome

    def _note(self, events: list[Event]) -> None:
        for event in events:
            log.log(level_of(event), event)
            if isinstance(event, ServerStopped):
                self.is_over = True
