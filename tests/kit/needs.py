"""Checks that the engine's timers agree with its parts: every part is asked after every step.

A part sets its timer when its deadline changes, and the engine does not ask it again. If a part
forgets that, it is called too late or never: a task does not start, an upload hangs. So after each
step of each scenario the engine's deadline is compared with those of its parts.
"""

from collections.abc import Iterator
from math import inf
from typing import Any

import pytest

from mav_tasks.engine.engine import Engine
from mav_tasks.engine.timers import Timer


class Needs:
    """Checks every step of every engine, and records deadlines that its timers miss."""

    def __init__(self) -> None:
        self.surprises: list[str] = []

    def look_on(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Start checking."""
        for name in ("__init__", "handle", "handle_deadline"):
            monkeypatch.setattr(Engine, name, self._then_compare(getattr(Engine, name)))

    def _then_compare(self, done: Any) -> Any:
        def step(engine: Engine, *args: Any, now: float, **kw: Any) -> None:
            done(engine, *args, now=now, **kw)
            self.compare(engine, now=now)

        return step

    def compare(self, engine: Engine, *, now: float) -> None:
        """Compare the timers of an engine with the deadlines of its parts."""
        due = engine.next_deadline()
        timers = {timer for _, _, _, timer in engine._timers.heap if timer.at < inf}
        first = min([timer.at for timer in timers], default=inf)
        if due != (None if first == inf else first):
            self.surprises.append(f"at {now}: {due} instead of {first}")
        rhythms = sum(timer.period < inf for timer in timers)
        links = len(list(engine._vehicles.links))
        if rhythms != links + 1:  # plus one for the clients' heartbeats
            self.surprises.append(f"at {now}: {rhythms} rhythms, {links} links to vehicles")
        for timer, need, who in needs_of(engine):
            if timer.at != need:
                self.surprises.append(f"at {now}: {timer.at} instead of {need}, by {who!r}")


def needs_of(engine: Engine) -> Iterator[tuple[Timer, float, object]]:
    """Yield the timer of each part, its deadline computed from its state alone, and the part."""
    e: Any = engine
    for vehicle in e._vehicles.all:
        yield e._vehicles.deadline_heap._due[vehicle.system_id], vehicle.next_deadline(), vehicle
    gate = e._submissions.gate
    yield gate._timer, gate._held[0][1] if gate._held else inf, gate
    for desk in e._reception.desks._desks.values():
        due = desk.uploads.receiver.next_deadline()
        yield desk.uploads.timer, inf if due is None else due, desk.uploads.receiver
    times = e._fleet.room.times
    yield e._starting, times.next_at, times
    limit = e._settings.watch.operator_lost
    yield e._operator._timer, e._operator._heard_at + limit, e._operator
    yield e._keeping, e.signatures.keep_at, e.signatures
    yield e._stopping, inf if e._stop_by is None or e._stopped else e._stop_by, "the end"
    news = [client.statuses.next_deadline() for client in e._gcs.clients]
    yield e._telling, min(news, default=inf), e._gcs.clients
    reports = e._reports
    yield reports._timer, reports._next_at if reports._claims else inf, reports
