"""Whether the engine's timers say what its parts need: each part is asked, one by one, each time.

A part sets its timer when its need changes, and nobody asks it again. One that forgets to is called
too late, or never: a task that does not begin, an upload that hangs. So after each step of each
scenario what the engine says is held against what its parts would say.
"""

from collections.abc import Iterator
from math import inf
from typing import Any

import pytest

from mav_tasks.engine.engine import Engine


class Needs:
    """Looks at every step of every engine, and keeps what its timers do not know."""

    def __init__(self) -> None:
        self.surprises: list[str] = []

    def look_on(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Look from here on."""
        for name in ("handle", "handle_deadline"):
            monkeypatch.setattr(Engine, name, self._then_compare(getattr(Engine, name)))

    def _then_compare(self, done: Any) -> Any:
        def step(engine: Engine, *args: Any, now: float) -> None:
            done(engine, *args, now=now)
            self.compare(engine, now=now)

        return step

    def compare(self, engine: Engine, *, now: float) -> None:
        """Ask every part of an engine."""
        said = engine.next_deadline()
        needs = list(needs_of(engine))
        first = min(at for _, at in needs)
        if said != (None if first == inf else first):
            who = [name for name, at in needs if at == first]
            self.surprises.append(f"at {now}: {said} instead of {first}, by {who}")


def needs_of(engine: Engine) -> Iterator[tuple[str, float]]:
    """Give when each part has something to do, by its state alone."""
    e: Any = engine
    for _, _, _, timer in e._timers.heap:
        if timer.period < inf:  # such a rhythm is nowhere else
            yield f"{timer}", timer.at
    for vehicle in e._vehicles.all:
        yield f"{vehicle}", vehicle.next_deadline()
    for held in list(e._submissions._gate._held)[:1]:
        yield "a submission", held.give_up_at
    for desk in e._desks._desks.values():
        due = desk.uploads.receiver.next_deadline()
        yield "an upload", inf if due is None else due
    times = e._fleet.room.times
    for heap in (times._starts, times._deadlines):
        yield "a task's time", heap[0][0] if heap else inf
    yield "the operator", e._operator._heard_at + e._settings.watch.operator_lost
    yield "signatures", e.signatures.keep_at
    yield "the end", inf if e._stop_by is None or e._stopped else e._stop_by
    for client in e._gcs.clients:
        yield f"{client}", client.statuses.next_deadline()
    reports = e._reports
    yield "reports", reports._next_at if reports._claims and len(e._vehicles) else inf
