"""Feeds a record to a fresh engine, and compares the outputs bit for bit."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from json import loads
from typing import Any

from mav_tasks.basics.errors import RecordError
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import KeysChanged, Outgoing, WallClock
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.packet import split_datagram
from mav_tasks.mavlink.signing import Key
from mav_tasks.recording.decisions import CLOSED
from mav_tasks.recording.reading import NOT_OURS, Entry, Record
from mav_tasks.recording.record_lines import MISSING, LineWriter, described, dumps
from mav_tasks.tasks.events import Event

MOST_NAMES = 12  # of packets, in a text


@dataclass(frozen=True, slots=True)
class Happened:
    """An event with its time; ``utc`` is seconds since 1970, None before the first WallClock."""

    now: float
    utc: float | None
    event: Event


@dataclass(frozen=True, slots=True)
class Difference:
    """The first difference, as text; ``line`` is the line of the last input before it."""

    line: int
    kind: str
    now: float
    expected: str
    came: str


class Replay:
    """One run of an engine on a record. Its results are complete after ``events`` is exhausted."""

    def __init__(self, record: Record, *, secrets: Mapping[str, bytes] | None = None) -> None:
        """``secrets``: of the keys, by fingerprint; the record has none."""
        self._record = record
        self._secrets = secrets or {}
        self._lines = LineWriter()
        self._utc_offset: float | None = None
        self._last: Entry | None = None  # the last input
        self.inputs = 0
        self.packets = 0
        self.event_count = 0
        self.difference: Difference | None = None
        #: the engine's error at the record's last input, as probably in the run; "": none
        self.failure = ""

    def __repr__(self) -> str:
        return f"Replay({self._record.path}, {self.inputs} inputs, {self.difference})"

    def events(self) -> Iterator[Happened]:
        """Replay the record; yield each event that is as recorded, until the first difference.

        Raise RecordError if a line cannot be parsed, or a key's secret is missing.
        """
        record = self._record
        engine = Engine(record.settings, now=record.now, restored=record.restored)
        for entry in record.entries():
            if self.failure:
                self._differs("the run continued", f"the engine failed: {self.failure}")
                self.failure = ""
                return
            if entry.kind == "out":
                yield from self._compare(engine, entry)
                if self.difference is not None:
                    return
            else:
                self._feed(engine, entry)
        if record.why_it_ends == CLOSED and not self.failure:
            self._look_for_more(engine)

    def _feed(self, engine: Engine, entry: Entry) -> None:
        item = self._record.input_of(entry)
        self._last = entry
        self.inputs += 1
        if isinstance(item, WallClock):
            self._utc_offset = item.offset
        elif isinstance(item, KeysChanged):
            item = KeysChanged(tuple(map(self._whole, item.keys)))
        try:
            if item is None:
                engine.handle_deadline(now=entry.now)
            else:
                engine.handle(item, now=entry.now)
        except Exception as mistake:  # noqa: BLE001 - a bug of the engine, which the record may show
            self.failure = f"{type(mistake).__name__}: {mistake}"

    def _whole(self, key: Key) -> Key:
        if key.secret != MISSING:
            return key
        secret = self._secrets.get(key.fingerprint)
        if secret is None:
            words = f"signed with key {key.name} ({key.fingerprint}): its secret is missing"
            words += "; use --keys FILE with the key ring of that server"
            raise RecordError(f"{self._record.path}: {words}")
        return replace(key, secret=secret)

    def _compare(self, engine: Engine, entry: Entry) -> Iterator[Happened]:
        packets, events = engine.take_packets(), engine.take_events()
        came = self._lines.given(packets, events, now=entry.now)
        if came.encode("ascii") != entry.raw:
            self._explain(entry, came, packets)
            return
        self.packets += len(packets)
        self.event_count += len(events)
        for event in events:
            utc = None if self._utc_offset is None else entry.now + self._utc_offset
            yield Happened(entry.now, utc, event)

    def _look_for_more(self, engine: Engine) -> None:
        """Report output of the engine after the end of a complete record."""
        packets, events = engine.take_packets(), engine.take_events()
        if packets or events:
            self._differs("nothing more", _in_words(packets, [str(event) for event in events]))

    def _explain(self, entry: Entry, came: str, packets: Sequence[Outgoing]) -> None:
        try:
            _, _, count, digest, rows = entry.values
            *_, given_digest, given_rows = loads(came)
            for index in range(max(len(rows), len(given_rows))):
                one, other = rows[index : index + 1], given_rows[index : index + 1]
                if dumps(one) != dumps(other):
                    self._differs(_event_in_words(one), _event_in_words(other))
                    return
            if (count, digest) != (len(packets), given_digest):
                expected = f"{count} packets (digest {digest})"
                self._differs(expected, f"{_in_words(packets, [])} (digest {given_digest})")
                return
        except NOT_OURS as error:
            words = f"{self._record.path}: line {entry.number} is unreadable: {error}"
            raise RecordError(words) from error
        self._differs(entry.raw.decode("ascii", "replace"), came)

    def _differs(self, expected: str, came: str) -> None:
        last = self._last
        self.difference = Difference(
            line=0 if last is None else last.number,
            kind="start" if last is None else last.kind,
            now=self._record.now if last is None else last.now,
            expected=expected,
            came=came,
        )


def _event_in_words(rows: Sequence[Sequence[Any]]) -> str:
    return described(rows[0]) if rows else "no event"


def _in_words(packets: Sequence[Outgoing], events: Sequence[str]) -> str:
    names = [_name(outgoing.data) for outgoing in packets[:MOST_NAMES]]
    more = ["…"] if len(packets) > MOST_NAMES else []
    said = f"{len(packets)} packets: {', '.join([*names, *more])}" if packets else "0 packets"
    return "; ".join([said, *events])


def _name(data: bytes) -> str:
    number = split_datagram(data)[0].message_id
    return str(m.ALL[number].msgname) if number in m.ALL else str(number)
