"""Random lives of the tasks of two rovers: the journal alone says which must begin, and none other.

What clients ask for is random: priorities, start times, deadlines, order, interruptions, changes,
pauses and stops. The model is what the events add up to, and when each task came.
"""

from collections.abc import Callable
from dataclasses import replace
from math import inf
from random import Random

import pytest

from mav_tasks.settings import Queueing, Settings
from mav_tasks.tasks.events import (
    QueueContinued,
    QueuePaused,
    TaskChanged,
    TaskModified,
    TaskSubmitted,
)
from mav_tasks.tasks.lifecycle import TERMINAL, TRANSITIONS, WAITING
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import Task
from tests.kit.client import MOVE
from tests.kit.volume import tries
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_waiting import (
    DEADLINE,
    MODIFY,
    PREEMPTIBLE,
    PREEMPTIVE,
    PRIORITY,
    RUN_AFTER,
    START_DELAY,
)

QUEUEING = Queueing(capacity=4, quota=6, aging=10.0, preemption_gap=4, preemption_rest=0.5)
ROVERS = (1, 2)
RUNNING = frozenset({S.STARTING, S.EXECUTING, S.CANCELLING})
CANCEL, CLEAR, RELEASE, AGAIN, SKIP = 54010, 54011, 54013, 0, 2
PATIENCE = 5.0  # s until what can begin has begun
LOOK = 0.1  # s
ASKED = 120
Rank = tuple[bool, float, float, int]


class Model:
    """Follows the journal of a world, and judges each event."""

    def __init__(self, world: World) -> None:
        self.world, self.seen = world, 0
        self.tasks: dict[int, Task] = {}
        self.came: dict[int, float] = {}
        self.paused: set[int] = set()
        self.went_on: dict[int, float] = {}  # when the running task of a rover began
        self.idle_since: dict[int, float] = {}
        self.interrupted: Task | None = None  # by the task that begins next

    def follow(self) -> None:
        events = self.world.server.store.events  # type: ignore[attr-defined]
        for event in events[self.seen :]:
            self.apply(event)
        self.seen = len(events)
        shown = {task.id: (task.state, task.terms, task.version) for task in self.world.tasks()}
        assert shown == {t.id: (t.state, t.terms, t.version) for t in self.tasks.values()}
        for rover in ROVERS:
            self.judge(rover)

    def apply(self, event: object) -> None:
        match event:
            case TaskSubmitted(task=task, at=at):
                assert task.id not in self.tasks
                self.tasks[task.id], self.came[task.id] = task, at
            case TaskModified(task_id=number, terms=terms, version=version):
                self.tasks[number] = replace(self.tasks[number], terms=terms, version=version)
            case TaskChanged(task_id=number, old=old, new=new, at=at):
                task = self.tasks[number]
                assert (task.state, task.version + 1) == (old, event.version)
                assert new in TRANSITIONS.get(old, {}), "terminal states are final"
                if old is S.SCHEDULED:
                    self.came[number] = max(self.came[number], task.terms.start_at or -inf)
                if (old, new) == (S.QUEUED, S.STARTING):
                    self.check_turn(task, at)
                if new is S.STARTING:
                    self.went_on[task.vehicle] = at
                if (new, event.reason) == (S.PAUSED, R.PREEMPTED):
                    self.interrupted = task
                self.tasks[number] = replace(task, state=new, version=event.version)
            case QueuePaused(vehicle=rover):
                self.paused.add(rover)
            case QueueContinued(vehicle=rover):
                self.paused.discard(rover)

    def of(self, rover: int, *states: S) -> list[Task]:
        return [t for t in self.tasks.values() if t.vehicle == rover and t.state in states]

    def check_turn(self, task: Task, at: float) -> None:
        """The most urgent begins, unless it interrupts another."""
        terms, ahead = task.terms, self.tasks.get(task.terms.after)
        assert task.vehicle not in self.paused, "nothing begins while the queue stands"
        assert (terms.start_at or -inf) <= at < (inf if terms.deadline is None else terms.deadline)
        assert ahead is None or ahead.state is S.COMPLETED
        assert not self.of(task.vehicle, S.HELD), "a held task blocks the queue"
        interrupted, self.interrupted = self.interrupted, None
        if interrupted is not None:
            assert self.may_interrupt(task, interrupted)
        else:
            others = self.of(task.vehicle, S.QUEUED, S.PAUSED)
            assert min(self.rank(other.id) for other in others) == self.rank(task.id)

    def may_interrupt(self, task: Task, running: Task) -> bool:
        """By what each was submitted or modified with, and nothing else."""
        if task.vehicle != running.vehicle or not running.terms.is_preemptible:
            return False
        if task.terms.is_preemptive:
            return not running.terms.is_preemptive or task.priority > running.priority
        return task.priority - running.priority >= QUEUEING.preemption_gap

    def rank(self, number: int) -> Rank:
        """Its own rank, or that of the most urgent one that waits for it, through others too."""
        task, came = self.tasks[number], self.came[number]
        own: Rank = (True, came - QUEUEING.aging * task.priority, came, number)
        if task.priority == 10:
            own = (False, 0.0, came, number)
        behind = [t for t in self.tasks.values() if t.terms.after == number and t.state in WAITING]
        return min([own, *(self.rank(other.id) for other in behind)])

    def judge(self, rover: int) -> None:
        """Whether all that waits has a reason to."""
        running, now = self.of(rover, *RUNNING), self.world.now
        waiting = self.of(rover, *WAITING)
        assert len(running) <= 1
        assert len(waiting) <= QUEUEING.capacity
        ready = self.of(rover, S.QUEUED)
        if running:
            rested = now - self.went_on[rover] > QUEUEING.preemption_rest
            free = rested and any(self.may_interrupt(task, running[0]) for task in ready)
        else:
            free = bool(ready or self.of(rover, S.PAUSED))
        if rover in self.paused or self.of(rover, S.HELD) or not free:
            self.idle_since[rover] = now
        idle = now - self.idle_since.setdefault(rover, now)
        assert idle < PATIENCE, f"rover {rover} waits, and need not: {self.world.describe()}"
        for task in (t for t in waiting if t.terms.after in self.tasks):
            over = self.tasks[task.terms.after].state in TERMINAL
            assert task.state is not (S.BLOCKED if over else S.QUEUED)


def wishes(world: World, random: Random) -> list[Callable[[], object]]:
    """Return what clients may ask for now."""
    client, rover = world.client, random.choice(ROVERS)
    live = [task for task in world.tasks() if task.state not in TERMINAL]
    mine = [task for task in live if task.vehicle == rover]
    any_one, number = (random.choice(several).id if several else 99 for several in (live, mine))
    held = [int(task.id) for task in mine if task.state is S.HELD] or [0]
    server = (rover, 191)

    def submit() -> None:
        after = random.choice((0, 0, any_one))
        delay = random.choice((0, 0, 0, 1.5, 4))
        length, priority = random.choice((0.2, 0.5, 3.0)), random.randrange(11)
        client.command(MOVE, length, 1, 0, 0, after, delay, priority, target=server)

    def modify() -> None:
        what, value = random.choice(
            (
                *((PRIORITY, random.randrange(11)), (START_DELAY, 1.5), (DEADLINE, 2.5)),
                *((RUN_AFTER, random.choice((0, any_one))), (PREEMPTIBLE, random.randrange(2))),
                *((PREEMPTIVE, random.randrange(2)),) * 2,
            )
        )
        client.command(MODIFY, number, what, value, target=server)

    return [
        *(submit,) * 8,
        *(modify,) * 6,
        *(lambda: client.proceed(target=server),) * 4,
        lambda: client.command(CANCEL, number, target=server),
        lambda: client.command(CLEAR, random.randrange(2), target=server),
        lambda: client.pause(target=server),
        lambda: client.stop(clear=random.random() < 0.5, target=server),
        lambda: client.command(RELEASE, held[0], random.choice((AGAIN, SKIP)), target=server),
    ]


@pytest.mark.parametrize("seed", range(tries(3, long=100)))
def test_whatever_is_asked_for_the_right_task_begins(make_world: MakeWorld, seed: int) -> None:
    world = make_world(seed=seed, rovers=2, settings=Settings(queueing=QUEUEING))
    random, model = Random(seed), Model(world)
    for _ in range(ASKED):
        random.choice(wishes(world, random))()
        for _ in range(random.choice((1, 3, 10, 25))):
            world.run(LOOK)
            model.follow()
    steps = {(e.old, e.new) for e in world.events(TaskChanged)}
    assert {(S.QUEUED, S.STARTING), (S.EXECUTING, S.COMPLETED), (S.BLOCKED, S.QUEUED)} <= steps
    assert len(world.client.acks) == ASKED, "each is answered once"
