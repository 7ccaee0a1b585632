"""The output of ``mav-tasks replay``: each event with its time, then the verdict."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any, TextIO

from mav_tasks.recording.decisions import CLOSED, project_version
from mav_tasks.recording.reading import Record
from mav_tasks.recording.replay import Difference, Happened, Replay
from mav_tasks.store.rendering import event_values


class Report:
    """Writes a replay's results as lines of text or JSON."""

    def __init__(self, out: TextIO, *, as_json: bool, quiet: bool) -> None:
        self._out = out
        self._as_json = as_json
        self._quiet = quiet

    def begin(self, record: Record) -> None:
        """Print the record's version if it differs from ours, which may explain a difference."""
        here = project_version()
        if record.version != here and not self._as_json:
            self._say(f"recorded by version {record.version}; this is {here}")

    def tell(self, happened: Happened) -> None:
        if self._quiet:
            return
        if self._as_json:
            self._put({"now": happened.now} | _as_logged(happened))
        else:
            self._say(f"{_time(happened)} {happened.event}")

    def conclude(self, record: Record, run: Replay) -> None:
        if self._as_json:
            self._put(
                {
                    "verdict": "same" if run.difference is None else "different",
                    "inputs": run.inputs,
                    "events": run.event_count,
                    "packets": run.packets,
                    "recorded_by": record.version,
                    "why_it_ends": record.why_it_ends,
                    "failure": run.failure or None,
                    "difference": None if run.difference is None else asdict(run.difference),
                }
            )
            return
        if run.difference is not None:
            self._explain(record, run.difference)
            return
        if run.failure:
            self._say(f"the engine failed at the last input, as it did in the run: {run.failure}")
        if record.why_it_ends is None:
            self._say("the record's end is missing: replayed up to its last whole line")
        elif record.why_it_ends != CLOSED:
            self._say(f"the record ends before the run did: {record.why_it_ends}")
        self._say(
            f"same: {run.inputs} inputs gave the same {run.event_count} events"
            f" and {run.packets} packets"
        )

    def _explain(self, record: Record, difference: Difference) -> None:
        self._say(
            f"different after line {difference.line} ({difference.kind} at {difference.now:.6f} s,"
            f" {difference.now - record.now:.6f} s into the run)"
        )
        self._say(f"  recorded: {difference.expected}")
        self._say(f"  replayed: {difference.came}")
        self._say(f"  recorded with Python {record.python} on {record.machine}")

    def _say(self, words: str) -> None:
        self._out.write(f"{words}\n")

    def _put(self, values: Mapping[str, Any]) -> None:
        self._say(json.dumps(values, ensure_ascii=False, allow_nan=False))


def _time(happened: Happened) -> str:
    if happened.utc is None:
        return f"{happened.now:14.6f} s"
    return f"{datetime.fromtimestamp(happened.utc, UTC):%Y-%m-%dT%H:%M:%S.%fZ}"


def _as_logged(happened: Happened) -> dict[str, Any]:
    """Return an event in the JSON form of log and journal; time None if UTC is unknown."""
    if happened.utc is None:
        return event_values(happened.event, offset=0.0) | {"time": None}
    return event_values(happened.event, offset=happened.utc - happened.now)
