"""Replays records through the core of the tree that it runs in, and says all that came of it.

A record has only digests of packets. For each line ``{"record": PATH, "secrets": {...}}`` on
standard input it writes lines of JSON that no later revision needs this one's code to read:

    {"now", "settings", "restored", "rows", "version", "why_it_ends"}
    ["task", row]                       of the run before, as many as there were
    ["in", now, [kind, now, ...]]       an input as it stands in the record
    ["out", now, [[link, peer, packet in base64, is_first], ...], number of events]
    ["next", deadline or null]          when the engine wants to be woken; at the end of an instant
    ["end", text]                       "same", or why this record is not to be compared

The first line of all is what the messages look like, ``{"layouts": ...}``.
"""

import json
import sys
from binascii import b2a_base64
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import KeysChanged
from mav_tasks.errors import RecordError
from mav_tasks.mavlink import messages as m
from mav_tasks.recording import reading
from mav_tasks.recording.record_lines import MISSING, LineWriter, input_of

dumps = json.JSONEncoder(separators=(",", ":"), check_circular=False).encode


class Otherwise(Exception):
    """This core does not decide again as the record says."""


def layouts() -> dict[int, list[Any]]:
    """Give name, struct format, field names in wire order and their numbers of values, by id."""
    return {
        number: [
            kind.msgname,
            kind.unpacker.format,
            list(kind.ordered_fieldnames),
            list(kind.lengths),
        ]
        for number, kind in m.ALL.items()
    }


def expanded(path: Path, secrets: dict[str, bytes]) -> Iterator[str]:
    """Give the lines of one record. RecordError, Otherwise."""
    record = reading.read(path)
    first = json.loads(next(iter(reading._numbered(path)))[1])
    head = {key: first[key] for key in ("now", "settings", "restored", "rows", "version")}
    yield dumps(head | {"why_it_ends": record.why_it_ends})
    count = 0 if record.restored is None else len(record.restored.tasks)
    for _, raw in islice(reading._numbered(path), 1, 1 + count):
        yield raw.decode("ascii")
    engine = Engine(record.settings, now=record.now, restored=record.restored)
    lines = LineWriter()
    now: float | None = None
    for entry in record.entries():
        if entry.kind == "out":
            packets, events = engine.take_packets(), engine.take_events()
            if lines.given(packets, events, now=entry.now).encode("ascii") != entry.raw:
                raise Otherwise(f"line {entry.number}, {entry.now:.3f} s")
            told = [[o.link, o.peer, _base64(o.data), o.is_first] for o in packets]
            yield dumps(["out", entry.now, told, len(events)])
            continue
        if now is not None and entry.now != now:
            yield dumps(["next", engine.next_deadline()])
        now = entry.now
        yield dumps(["in", entry.now, list(entry.values)])
        item = input_of(entry.values)
        if item is None:
            engine.handle_deadline(now=entry.now)
            continue
        if isinstance(item, KeysChanged):
            item = KeysChanged(tuple(_whole(key, secrets) for key in item.keys))
        engine.handle(item, now=entry.now)
    yield dumps(["next", engine.next_deadline()])


def _whole(key: Any, secrets: dict[str, bytes]) -> Any:
    if key.secret != MISSING:
        return key
    name = f"{key.name} {key.fingerprint}"  # keys of tests may have no fingerprint
    if name not in secrets:
        raise Otherwise(f"the secret of key {key.name} is not known")
    return replace(key, secret=secrets[name])


def _base64(data: bytes) -> str:
    return b2a_base64(data, newline=False).decode("ascii")


def main() -> None:
    """Expand each record that is asked for."""
    print(dumps({"layouts": layouts()}), flush=True)
    for line in sys.stdin:
        asked = json.loads(line)
        secrets = {name: bytes.fromhex(value) for name, value in asked["secrets"].items()}
        out = sys.stdout
        try:
            for text in expanded(Path(asked["record"]), secrets):
                out.write(text + "\n")
            end = "same"
        except (RecordError, Otherwise) as error:
            end = f"not replayed by its own revision: {error}"
        except Exception as error:  # noqa: BLE001 - tests break engines on purpose
            end = f"its own revision fails on it: {type(error).__name__}: {error}"
        out.write(dumps(["end", end]) + "\n")
        out.flush()


if __name__ == "__main__":
    main()
