"""100,000 waiting tasks: the cost to submit and take one, memory, and restart."""

import gc
import tracemalloc
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, perf_counter

from mav_tasks.config.settings import Queueing, Settings
from mav_tasks.engine.engine import Engine
from mav_tasks.kinds import Move
from mav_tasks.shell.serve import tame_collector
from mav_tasks.store.sqlite import SqliteStore
from mav_tasks.tasks.pending_tasks import PendingTasks
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Draft, Marks, Submitter, Terms

from .table import Row

FEW, MANY = 1_000, 100_000
SAMPLE = 2_000  # tasks submitted and taken while the others wait
GOAL_RATIO = 2.0
GOAL_BYTES = 2_048
GOAL_RESTART = 3.0  # s
SETTINGS = replace(Settings(), queueing=Queueing(capacity=10 * MANY, quota=10 * MANY))
SUBMITTER = Submitter("link", "127.0.0.1:50000", 255, 190)
KEPT_EVENTS = 10_000


def measure() -> list[Row]:
    """Return the rows of time, memory and restart."""
    tame_collector()  # as the server does
    few, _ = _times(FEW)
    many, kept = _times(MANY)
    restart = _restart()
    return [
        Row(
            f"submit + take a task, {MANY:,} wait",
            f"{many * 1e6:.1f} µs",
            f"{few * 1e6:.1f} µs with {FEW:,}",
            f"{many / few:.2f}×",
            f"≤ {GOAL_RATIO:.0f}×",
            many <= GOAL_RATIO * few,
        ),
        Row(
            "memory of a waiting task",
            f"{kept:,.0f} bytes",
            "",
            "",
            f"< {GOAL_BYTES:,} bytes",
            kept < GOAL_BYTES,
        ),
        Row(
            f"restart with {MANY:,} waiting",
            f"{restart:.2f} s",
            "",
            "",
            f"< {GOAL_RESTART:.0f} s",
            restart < GOAL_RESTART,
        ),
    ]


def _draft(number: int) -> Draft:
    marks = Marks(number, f"{number:018x}", f"{number:018x}")
    return Draft(1, 54000, Move(1.0 + number), SUBMITTER, Terms(priority=number % 11), marks)


def _fill(count: int) -> tuple[TaskRegistry, PendingTasks]:
    book = TaskRegistry()
    room = PendingTasks(book, SETTINGS)
    for number in range(count):
        room.submit(_draft(number), now=number * 1e-3)
        if number % KEPT_EVENTS == 0:
            book.take_events()
    book.take_events()
    return book, room


def _times(count: int) -> tuple[float, float]:
    """Return seconds per task submitted and taken, and bytes per waiting task."""
    book, room = _fill(count)
    drafts = [_draft(count + number) for number in range(SAMPLE)]
    start = perf_counter()
    for draft in drafts:
        room.submit(draft, now=count * 1e-3)
    for _ in range(SAMPLE):
        first = room.queue(1).first()
        assert first is not None
        room.leave(book[first])
    taken = (perf_counter() - start) / SAMPLE
    del book, room
    tracemalloc.start()
    kept = _fill(count)
    size = tracemalloc.get_traced_memory()[0] / count
    tracemalloc.stop()
    del kept
    return taken, size


def _restart() -> float:
    """Return the seconds from opening the store to an engine with all tasks restored."""
    with TemporaryDirectory(dir=Path.cwd()) as folder:
        path = Path(folder) / "tasks.sqlite3"
        store = SqliteStore(path, wall_offset=_no_offset)
        book = TaskRegistry()
        room = PendingTasks(book, SETTINGS)
        for number in range(MANY):
            room.submit(_draft(number), now=monotonic())
        store.append(book.take_events())
        store.close()
        gc.collect()
        gc.disable()  # like the server, until everything is restored
        start = perf_counter()
        store = SqliteStore(path, wall_offset=_no_offset)
        Engine(SETTINGS, now=monotonic(), restored=store.load())
        taken = perf_counter() - start
        tame_collector()
        store.close()
        return taken


def _no_offset() -> float:
    return 0.0
