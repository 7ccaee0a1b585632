"""This checkout's core, fed with what another revision's core was told, at the same times."""

from binascii import a2b_base64
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, get_type_hints

from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import Committed, KeysChanged, Outgoing
from mav_tasks.recording.record_lines import MISSING, input_of
from mav_tasks.recording.surroundings import restored_of, settings_of
from mav_tasks.settings import Settings
from mav_tasks.store.codec import Decoder
from mav_tasks.tasks.task import Task

from .wire import Layouts, Sent

#: what earlier revisions had no word for in what a store gave back, and what it is worth then
RESTORED_BEFORE: Mapping[str, Any] = {"homes": [], "idle": 0.0}
SAME_TIME = 1e-9  # s


class NewCore:
    """An engine whose inputs stand in another revision's record.

    Event numbers are its own: ``Committed`` is translated, as it may journal more than the old one
    did, or less. It is woken when the old core was, if it wanted to be, and at times of its own.
    """

    def __init__(
        self, head: Mapping[str, Any], tasks: Sequence[list[Any]], secrets: Mapping[str, bytes]
    ) -> None:
        """``head`` and the rows of ``tasks`` as ``inside/expand`` gives them."""
        restored = None
        if head["restored"] is not None:
            rows = {name: tuple(places) for name, places in head["rows"].items()}
            found = Decoder(rows, is_exact=True).values(Task, tasks, offset=0.0)
            restored = restored_of({**RESTORED_BEFORE, **head["restored"]}, tuple(found))
        settings = settings_of(known(head["settings"]))
        self.engine = Engine(settings, now=head["now"], restored=restored)
        self._secrets = secrets
        self._events = 0  # of this core so far
        self._committed = 0
        self._old_events = 0
        self._old_committed = 0
        self._numbers: list[tuple[int, int]] = []  # old and own number of events, after each turn
        self._is_store_away = False  # until it has committed something again
        self._taken: list[Outgoing] = []
        self.skipped = 0  # wake-ups that only the old core wanted
        self.added = 0  # and those that only this one did

    def feed(self, line: Sequence[Any], *, now: float) -> None:
        """Take an input as it stands in a record."""
        kind = line[0]
        if kind == "deadline":
            due = self.engine.next_deadline()
            if due is None or due > now + SAME_TIME:
                self.skipped += 1
                return
            self.engine.handle_deadline(now=now)
        elif kind == "committed":
            self._is_store_away = False
            self._commit(line[2], now=now)
        else:
            self._is_store_away = self._is_store_away or kind == "store failed"
            if kind == "settings":
                line = [*line[:2], known(line[2])]
            item = input_of(line)
            assert item is not None
            if isinstance(item, KeysChanged):
                item = KeysChanged(tuple(map(self._whole, item.keys)))
            self.engine.handle(item, now=now)

    def old_turn(self, events: int) -> None:
        """Note that the old core gave so many events in a turn that is over."""
        self._take()
        self._old_events += events
        self._numbers.append((self._old_events, self._events))

    def wake_between(self, old_due: float | None, until: float) -> list[float]:
        """Give when it wants to be woken before ``until``, where the old core did not; do that.

        A server that was kept from running did not wake the old core either.
        """
        due = self.engine.next_deadline()
        starved = old_due is not None and old_due < until - SAME_TIME
        if due is None or due >= until - SAME_TIME or starved:
            return []
        self.added += 1
        self.engine.handle_deadline(now=due)
        return [due]

    def end_instant(self, layouts: Layouts, *, now: float) -> list[Sent]:
        """Give all packets since the last instant; events that only this core has are durable.

        They are not while the store is away: it would seem to be back.
        """
        self._take()
        is_stored = self._old_committed == self._old_events and not self._is_store_away
        while self._events > self._committed and is_stored:
            self._committed = self._events
            self.engine.handle(Committed(self._events), now=now)
            self._take()
        taken, self._taken = self._taken, []
        return [Sent(o.link, o.peer, o.data, o.is_first, layouts) for o in taken]

    def _take(self) -> None:
        self._taken += self.engine.take_packets()
        self._events += len(self.engine.take_events())

    def _commit(self, through: int, *, now: float) -> None:
        self._take()
        self._old_committed = through
        own = next((own for old, own in self._numbers if old >= through), self._events)
        if through >= self._old_events:
            own = self._events
        self._numbers = [pair for pair in self._numbers if pair[0] > through]
        if own > self._committed:
            self._committed = own
            self.engine.handle(Committed(own), now=now)

    def _whole(self, key: Any) -> Any:
        if key.secret != MISSING:
            return key
        return replace(key, secret=self._secrets[f"{key.name} {key.fingerprint}"])


def known(values: Mapping[str, Any], kind: Any = Settings) -> dict[str, Any]:
    """Give settings without those that this revision has no more."""
    hints = get_type_hints(kind)
    return {
        name: known(value, hints[name])
        if isinstance(value, dict) and _nests(hints[name])
        else value
        for name, value in values.items()
        if name in hints
    }


def sent_of(rows: Sequence[Sequence[Any]], layouts: Layouts) -> list[Sent]:
    """Give the packets of an "out" line."""
    return [
        Sent(link, _peer(peer), a2b_base64(data), is_first, layouts)
        for link, peer, data, is_first in rows
    ]


def _peer(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _nests(hint: Any) -> bool:
    return hasattr(hint, "__dataclass_fields__")
