"""A series through random crashes, outages and ends: each planned time is one run, or is said.

The journal is a list of turns; a crash loses the last ones, and each turn as a whole.
"""

import re
from dataclasses import dataclass, field, fields, replace

import hypothesis.strategies as st
from hypothesis import given, settings

from mav_tasks.settings import Settings
from mav_tasks.tasks.events import (
    Event,
    TaskChanged,
    TaskModified,
    TaskSubmitted,
    VehicleNoted,
)
from mav_tasks.tasks.fleet import Fleet
from mav_tasks.tasks.lifecycle import TERMINAL, WAITING
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.repetition import repeating
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Task
from tests.unit.tasks.samples import draft

PERIOD = 10
OFFSET = 1_800_000_000.0  # s, UTC minus monotonic
LEFT_OUT = re.compile(r"left out (\d+) run")


@dataclass
class Server:
    """The tasks of one rover, and what is stored of them."""

    now: float = 100.0
    turns: list[list[Event]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.boot()
        task = self.fleet.of(1).submit(draft(), now=self.now)
        self.turn()
        terms = repeating(task, str(PERIOD), now=self.now, wall_offset=OFFSET)
        self.fleet.of(1).modify(task, terms, actor="client", now=self.now)
        self.turn()

    def boot(self) -> None:
        """Start on what is stored."""
        self.registry = TaskRegistry()
        self.fleet = Fleet(self.registry, Settings(on_restart="continue"))
        tasks = self.stored()
        next_id = 1 + max((task.id for task in tasks), default=0)
        restored = Restored(tasks=tasks, next_id=next_id, wall_offset=OFFSET)
        self.fleet.restore(restored, now=self.now)

    def stored(self) -> tuple[Task, ...]:
        """Return the tasks as the events have left them."""
        tasks: dict[int, Task] = {}
        for event in (event for turn in self.turns for event in turn):
            match event:
                case TaskSubmitted(task=task):
                    tasks[task.id] = task
                case TaskModified(terms=terms, version=version):
                    old = tasks[event.task_id]
                    tasks[event.task_id] = replace(old, terms=terms, version=version)
                case TaskChanged():
                    common = {f.name for f in fields(event)} & {f.name for f in fields(Task)}
                    new = {name: getattr(event, name) for name in common - {"vehicle"}}
                    tasks[event.task_id] = replace(
                        tasks[event.task_id], **new, state=event.new, changed_at=event.at
                    )
        return tuple(tasks.values())

    def turn(self) -> None:
        """End a turn as the engine does: what has happened is stored as a whole."""
        self.fleet.room.handle_deadline(now=self.now)
        self.fleet.room.plan_runs(now=self.now)
        events = self.registry.take_events()
        if events:
            self.turns.append(events)

    @property
    def run(self) -> Task:
        """The run that is not over."""
        (live,) = [task for task in self.registry.all() if task.state not in TERMINAL]
        return live

    def act(self, what: str) -> None:
        """Begin or end the run, in a way that fits its state."""
        run = self.run
        if run.state in WAITING:
            if what == "cancel":
                self.fleet.room.end(run, S.CANCELLED, R.CANCELLED, actor="client", now=self.now)
            elif run.state is S.QUEUED:
                self.fleet.room.leave(run)
                self.change(run, S.STARTING)
            return
        if run.state is S.HELD:
            self.change(run, S.CANCELLED, R.SKIPPED)
            return
        new = {
            S.STARTING: {"go": S.EXECUTING, "cancel": S.CANCELLING, "fail": S.FAILED},
            S.EXECUTING: {"go": S.COMPLETED, "cancel": S.CANCELLING, "fail": S.FAILED},
            S.CANCELLING: dict.fromkeys(("go", "cancel", "fail"), S.CANCELLED),
        }[run.state][what]
        self.change(run, new, R.CANCELLED if new in (S.CANCELLING, S.CANCELLED) else R.NONE)

    def change(self, run: Task, new: S, reason: R = R.NONE) -> None:
        self.registry.change(run.id, new, reason=reason, actor="client", now=self.now)
        if new in TERMINAL:
            self.fleet.room.ended(run.id, now=self.now)

    def crash(self, lost: int, away: float) -> None:
        """Lose the last turns, but not the submission, and start again later."""
        del self.turns[max(len(self.turns) - lost, 2) :]
        self.now += away
        self.boot()


ACTS = st.sampled_from(["go", "go", "go", "cancel", "fail"])
TIMES = st.sampled_from([0.0, 0.5, 3.0, 9.9, 10.0, 10.1, 25.0, 60.0, 1234.5])
STEP = st.one_of(ACTS, TIMES, st.tuples(st.integers(0, 4), TIMES))


@settings(max_examples=500)
@given(st.lists(STEP, max_size=40))
def test_each_planned_time_is_one_run_or_is_said_to_be_left_out(
    steps: list[str | float | tuple[int, float]],
) -> None:
    server = Server()
    for step in steps:
        match step:
            case str():
                server.act(step)
            case float():
                server.now += step
            case lost, away:
                server.crash(lost, away)
        server.turn()
        _check(server)


def _check(server: Server) -> None:
    tasks = sorted(server.stored(), key=lambda task: task.id)
    assert tasks == sorted(server.registry.all(), key=lambda task: task.id)
    assert [task.state in TERMINAL for task in tasks] == [*[True] * (len(tasks) - 1), False]
    assert {task.terms.series for task in tasks} == {1}
    first = tasks[0].submitted_at
    planned = [(task.terms.start_at or 0.0) - first for task in tasks]
    numbers = [round(start / PERIOD) for start in planned]
    assert planned == [number * PERIOD for number in numbers]
    assert numbers == sorted(set(numbers)), "two runs of one planned time"
    said = sum(
        int(found[1])
        for turn in server.turns
        for event in turn
        if isinstance(event, VehicleNoted) and (found := LEFT_OUT.match(event.text))
    )
    assert said == numbers[-1] + 1 - len(numbers)
