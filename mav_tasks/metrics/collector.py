"""Counts what happens in the event loop, as an observer of the engine.

It runs between a packet and its answer, so it only adds to counters and fixed-size histograms. The
thread that shows them never reads them: it asks the loop for parts, small immutable copies.
"""

import platform
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

from mav_tasks.basics.clock import boot_time
from mav_tasks.basics.histogram import Distribution, Histogram
from mav_tasks.engine.figures import Figures
from mav_tasks.engine.inputs import (
    AtOnce,
    Committed,
    HaltNotStored,
    Input,
    LinkSide,
    Outgoing,
    Packets,
    Peer,
    PeerChanged,
    Shutdown,
    StoreFailed,
)
from mav_tasks.links.base import CountingLink, Link, ListeningLink
from mav_tasks.metrics import families as f
from mav_tasks.metrics.exposition import Family
from mav_tasks.metrics.stops import Stops
from mav_tasks.tasks.events import (
    Event,
    QueueContinued,
    SubmissionRefused,
    TaskChanged,
    TaskModified,
    TaskSubmitted,
    TaskWithdrawn,
    VehicleHalted,
)
from mav_tasks.tasks.lifecycle import TERMINAL, WAITING, TaskReason, TaskState
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Task, TaskId

#: s, bounds of the histograms
WAITS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0, 300.0, 900.0, 3600.0, 14400.0)
COMMITS = (2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 1.0, 5.0)

INTERRUPTED = frozenset({TaskState.PAUSED, TaskState.HELD})
STALLED = 0.3  # s; what waited longer to be read waited while the server was stalled

#: label values, not yet as text, and the figure
Raw = tuple[tuple[object, ...], float | Distribution]
#: samples by family; nobody changes it any more
Part = Mapping[Family, Sequence[Raw]]


@runtime_checkable
class Recorder(Protocol):
    """A recorder that may lose packets."""

    @property
    def lost(self) -> int:
        """Number of lost packets."""


class LinkCounts:
    """Traffic of one link since the start."""

    __slots__ = ("connected", "link", "received", "received_bytes", "sent", "sent_bytes", "side")

    def __init__(self, link: Link, side: LinkSide) -> None:
        self.link = link
        self.side = side
        self.received = self.received_bytes = self.sent = self.sent_bytes = 0
        self.connected: set[Peer] = set()  # of a stream

    def __repr__(self) -> str:
        return f"LinkCounts({self.link.name}, {self.received} in, {self.sent} out)"

    @property
    def is_up(self) -> bool:
        """Whether packets can pass."""
        return bool(self.connected) or not self.link.is_stream


class Collector:
    """Implements ``EngineObserver``. Only the loop's thread uses it."""

    def __init__(
        self,
        figures: Figures,
        *,
        links: Mapping[LinkSide, Sequence[Link]],
        recorders: Sequence[object],
        restored: Restored | None,
        version: str,
        woke_at: Callable[[], float],
        clock: Callable[[], float] = boot_time,
    ) -> None:
        """``woke_at`` returns when the loop began to read what it handles now, s of ``clock``."""
        self._figures = figures
        self._links = {
            link.name: LinkCounts(link, side) for side, some in links.items() for link in some
        }
        self._recorders = [each for each in recorders if isinstance(each, Recorder)]
        self._version = version
        self._clock = clock
        self._stops = Stops(figures, clock=clock, woke_at=woke_at)
        self._inputs = 0
        self._counters: dict[Family, dict[tuple[object, ...], int]] = defaultdict(
            lambda: defaultdict(int)
        )
        self._submitted: dict[TaskId, float] = {}  # tasks that have not started
        self._staged: dict[TaskId, int] = {}  # of those: by vehicle
        self._waits = Histogram(WAITS)
        self._commits = Histogram(COMMITS)
        self._events = 0  # number of the last one
        self._durable = 0
        self._uncommitted: deque[tuple[int, float]] = deque()  # last event of a turn, and its time
        self._store_fault = ""
        self._is_ending = False
        #: a bug of ours has ended the counting: see ``EngineObservers``
        self.is_broken = False
        self._on_input: dict[type, Callable[[Any, float], None]] = {
            Packets: self._receive,
            AtOnce: self._receive_several,
            Committed: self._commit,
            StoreFailed: self._fail,
            HaltNotStored: self._note_halt_not_stored,
            PeerChanged: self._change_peer,
            Shutdown: self._shut_down,
        }
        self._on_event: dict[type, Callable[[Any], None]] = {
            TaskSubmitted: self._submit,
            TaskModified: self._modify,
            TaskChanged: self._change,
            TaskWithdrawn: self._withdraw,
            SubmissionRefused: self._refuse,
            VehicleHalted: self._halt,
            QueueContinued: self._resume,
        }
        for task in () if restored is None else restored.tasks:
            if task.state in WAITING:
                self._await(task)

    def __repr__(self) -> str:
        return f"Collector({self._inputs} inputs)"

    # observer

    def on_input(self, item: Input | None, *, now: float) -> None:
        """Count an input."""
        try:
            self._inputs += 1
            if self._stops.look_at <= now:
                self._stops.look(now=now)
            note = self._on_input.get(type(item))
            if note is not None:
                note(item, now)
        except Exception:
            self.is_broken = True
            raise

    def on_output(
        self, packets: Sequence[Outgoing], events: Sequence[Event], *, now: float
    ) -> None:
        """Count packets and events."""
        try:
            links = self._links
            for outgoing in packets:
                counts = links[outgoing.link]
                counts.sent += 1
                counts.sent_bytes += len(outgoing.data)
            if events:
                self._note_events(packets, events, now)
        except Exception:
            self.is_broken = True
            raise

    def _note_events(
        self, packets: Sequence[Outgoing], events: Sequence[Event], now: float
    ) -> None:
        self._events += len(events)
        self._uncommitted.append((self._events, now))
        self._stops.note(packets, events, now=now)
        for event in events:
            note = self._on_event.get(type(event))
            if note is not None:
                note(event)

    def close(self) -> None:
        """Do nothing: there is nothing to close."""

    # for the thread that shows it, called in the loop

    def why_not_ready(self) -> str:
        """Return in one line why the server cannot do its work; "" if it can."""
        if self._is_ending:
            return "the server is ending"
        if self._store_fault:
            return f"new tasks are refused: {' '.join(self._store_fault.split())}"
        if not any(each.is_up for each in self._links.values() if each.side is LinkSide.VEHICLES):
            return "no link to a rover is open"
        return ""

    def totals(self) -> tuple[Part, tuple[int, ...]]:
        """Return the figures of the whole server, and the ids of the vehicles."""
        figures = self._figures.all()
        part: dict[Family, Sequence[Raw]] = {
            f.BUILD: [((self._version, platform.python_version()), 1)],
            f.INPUTS: [((), self._inputs)],
            f.WAIT: [((), self._waits.figures())],
            f.STOP_LATENCY: [((), self._stops.latency.figures())],
            f.STOP_STANDSTILL: [((), self._stops.standstill.figures())],
            f.CLIENTS: [((), figures.clients)],
            f.CORRUPT: [((side,), count) for side, count in figures.corrupt],
            f.FLOODED: [((), figures.flooded)],
            f.COMMIT: [((), self._commits.figures())],
            f.PENDING: [((), self._events - self._durable)],
            f.WRITABLE: [((), 0 if self._store_fault else 1)],
            f.RECORDING_LOST: [((), sum(each.lost for each in self._recorders))],
        }
        for family, counts in self._counters.items():
            part[family] = tuple(counts.items())
        part.update(_of_links(self._links.values()))
        return part, figures.vehicles

    def vehicles(self, system_ids: Iterable[int]) -> Part:
        """Return the figures of some vehicles."""
        part: dict[Family, list[Raw]] = defaultdict(list)
        now = self._clock()
        staged: dict[int, int] = defaultdict(int)
        for vehicle in self._staged.values():
            staged[vehicle] += 1
        for vehicle in system_ids:
            found = self._figures.of(vehicle, now=now)
            if found is None:
                continue
            for state, reason, count in found.tasks:
                if (state, reason) == (TaskState.BLOCKED, TaskReason.DEPENDENCY):
                    first = min(count, staged[vehicle])
                    count -= first
                    if first:
                        key = (vehicle, state, TaskReason.WAITING_FOR_START)
                        part[f.TASKS].append((key, first))
                if count:
                    part[f.TASKS].append(((vehicle, state, reason), count))
            is_paused = int(found.paused is not TaskReason.NONE)
            part[f.QUEUE_LENGTH].append(((vehicle,), found.waiting))
            part[f.QUEUE_CAPACITY].append(((vehicle,), found.capacity))
            part[f.QUEUE_PAUSED].append(((vehicle, found.paused), is_paused))
            part[f.INTERVAL].append(((vehicle,), found.intervals))
            part[f.PERIOD].append(((vehicle,), found.period))
            part[f.HEARTBEAT_AGE].append(((vehicle,), found.heartbeat_age))
            part[f.POSITION_AGE].append(((vehicle,), found.position_age))
        return part

    # inputs

    def _receive(self, item: Packets, _now: float) -> None:
        counts = self._links[item.link]
        counts.received += len(item.datagrams)
        size = 0
        for _, data in item.datagrams:  # faster than a generator expression
            size += len(data)
        counts.received_bytes += size

    def _receive_several(self, item: AtOnce, now: float) -> None:
        for packets in item.packets:
            self._receive(packets, now)
        oldest = min((at for packets in item.packets for at in packets.arrived), default=now)
        self._stops.waited = now - oldest if now - oldest > STALLED else 0.0

    def _commit(self, item: Committed, now: float) -> None:
        self._durable, self._store_fault = item.through, ""
        waiting = self._uncommitted
        while waiting and waiting[0][0] <= item.through:
            self._commits.note(now - waiting.popleft()[1])

    def _fail(self, item: StoreFailed, _now: float) -> None:
        self._store_fault = item.text

    def _note_halt_not_stored(self, item: HaltNotStored, _now: float) -> None:
        self._counters[f.HALTS_NOT_STORED][item.vehicle,] += 1

    def _change_peer(self, item: PeerChanged, _now: float) -> None:
        connected = self._links[item.link].connected
        (connected.add if item.up else connected.discard)(item.peer)

    def _shut_down(self, _item: Shutdown, _now: float) -> None:
        self._is_ending = True

    # events

    def _submit(self, event: TaskSubmitted) -> None:
        self._counters[f.SUBMITTED][event.task.vehicle,] += 1
        self._await(event.task)

    def _await(self, task: Task) -> None:
        self._submitted[task.id] = task.submitted_at
        if task.terms.is_staged:
            self._staged[task.id] = task.vehicle

    def _modify(self, event: TaskModified) -> None:
        if event.terms.is_staged:
            self._staged[event.task_id] = event.vehicle
        else:
            self._staged.pop(event.task_id, None)

    def _change(self, event: TaskChanged) -> None:
        new, reason = event.new, event.reason
        if new not in WAITING:
            submitted_at = self._submitted.pop(event.task_id, None)
            self._staged.pop(event.task_id, None)
            if submitted_at is not None and new not in TERMINAL:
                self._waits.note(max(0.0, event.at - submitted_at))
        if new in TERMINAL:
            self._counters[f.ENDED][event.vehicle, new, reason] += 1
        elif new in INTERRUPTED:
            self._counters[f.INTERRUPTED][event.vehicle, new, reason] += 1

    def _withdraw(self, event: TaskWithdrawn) -> None:
        self._submitted.pop(event.task_id, None)
        self._staged.pop(event.task_id, None)

    def _refuse(self, event: SubmissionRefused) -> None:
        self._counters[f.REFUSED][event.reason,] += 1

    def _halt(self, event: VehicleHalted) -> None:
        self._counters[f.HALTS][event.vehicle, event.reason] += 1

    def _resume(self, event: QueueContinued) -> None:
        self._stops.resumed(event.vehicle)


def _of_links(links: Iterable[LinkCounts]) -> dict[Family, list[Raw]]:
    part: dict[Family, list[Raw]] = defaultdict(list)
    for each in links:
        link, name = each.link, each.link.name
        part[f.LINK_UP].append(((name, each.side), int(each.is_up)))
        part[f.LINK_PACKETS].append(((name, "sent"), each.sent))
        if not link.is_stream:
            part[f.LINK_PACKETS].append(((name, "received"), each.received))
        part[f.LINK_BYTES].append(((name, "sent"), each.sent_bytes))
        part[f.LINK_BYTES].append(((name, "received"), each.received_bytes))
        if isinstance(link, CountingLink):
            part[f.LINK_LOST].append(((name,), link.lost))
        if isinstance(link, ListeningLink):
            part[f.LINK_REFUSED].append(((name,), link.refused))
    return part
