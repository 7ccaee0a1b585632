"""Random lives of tasks of two vehicles, with times, dependencies and restarts, beside a model."""

from collections.abc import Callable
from dataclasses import replace
from math import inf
from typing import NamedTuple

import hypothesis.strategies as st
from hypothesis import settings
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from mav_tasks.errors import Rejection
from mav_tasks.settings import Queueing, Settings
from mav_tasks.tasks.events import (
    Event,
    QueueContinued,
    QueuePaused,
    TaskAdvanced,
    TaskChanged,
    TaskModified,
    TaskSubmitted,
    TaskWithdrawn,
)
from mav_tasks.tasks.fleet import Fleet
from mav_tasks.tasks.goal import Wait
from mav_tasks.tasks.lifecycle import TERMINAL, TRANSITIONS, WAITING, TaskReason, TaskState
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Draft, Frame, Task, TaskId, Terms
from mav_tasks.tasks.view import DemandKind, VehicleView
from tests.unit.tasks.samples import draft, idle_vehicle, ours

S, R = TaskState, TaskReason
QUEUEING = Queueing(capacity=5, quota=8, aging=2.0, preemption_gap=4, preemption_rest=0.2)
VEHICLES = (1, 2)
RUNNING = frozenset({S.STARTING, S.EXECUTING, S.CANCELLING})
REFUSALS = frozenset({R.QUEUE_FULL, R.QUOTA, R.UNKNOWN_DEPENDENCY, R.DEPENDENCY_FAILED, R.CYCLE})
TICK = 0.1
PATIENCE = 3  # ticks until what can begin has begun

vehicles = st.sampled_from(VEHICLES)


class Wish(NamedTuple):
    """What a client asks for, times counted from then."""

    vehicle: int
    priority: int
    delay: float | None
    at_utc: int | None
    within: float | None
    after: int  # how many tasks before this one; 0: none
    is_preemptible: bool
    is_preemptive: bool
    seconds: float


seldom = st.sampled_from([True, False, False])
wishes = st.builds(
    Wish,
    vehicle=vehicles,
    priority=st.integers(0, 10),
    delay=st.sampled_from([None] * 6 + [0.5, 3.0]),
    at_utc=st.sampled_from([None] * 8 + [-1, 2, 5]),
    within=st.sampled_from([None] * 4 + [1.0, 4.0]),
    after=st.sampled_from([0, 0, 1, 2, 4]),
    is_preemptible=seldom.map(lambda unusual: not unusual),
    is_preemptive=seldom,
    seconds=st.sampled_from([0.0, 0.3, 3.0, 30.0]),
)
changes = st.one_of(
    st.tuples(st.just("priority"), st.integers(0, 10)),
    st.tuples(st.just("start_at"), st.just(1.0)),
    st.tuples(st.just("deadline"), st.just(2.0)),
    st.tuples(st.just("after"), st.just(0)),
    st.tuples(st.just("is_preemptive"), st.booleans()),
)
Key = tuple[bool, float, float, int]


def refused(ask: Callable[[], object]) -> TaskReason | None:
    """Why something that was asked for was refused, None if it was done."""
    try:
        ask()
    except Rejection as refusal:
        return TaskReason(refusal.reason)
    return None


class Lives(RuleBasedStateMachine):
    """The model is the journal: what its events add up to, and when each task came."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 10.0
        self.offset = 1_000.0
        self.is_ours = dict.fromkeys(VEHICLES, False)
        self.tasks: dict[int, Task] = {}
        self.came: dict[int, float] = {}
        self.paused: dict[int, TaskReason] = {}
        self.interrupted: Task | None = None  # by the task that begins next
        self.began: dict[int, float] = {}  # when the running task of a vehicle went on
        self.last_id = 0
        self.begin()

    def begin(self, restored: Restored | None = None) -> None:
        self.registry = TaskRegistry()
        self.fleet = Fleet(self.registry, Settings(queueing=QUEUEING))
        self.fleet.restore(restored or Restored(wall_offset=self.offset), now=self.now)
        self.follow()

    # what clients do

    @rule(wishes=st.lists(wishes, min_size=1, max_size=3))
    def submit(self, wishes: list[Wish]) -> None:
        for wish in wishes:
            self.take_in(
                replace(draft(Wait(wish.seconds), vehicle=wish.vehicle), terms=self.terms(wish))
            )

    def terms(self, wish: Wish) -> Terms:
        return Terms(
            wish.priority,
            max(0, self.last_id + 1 - wish.after) if wish.after else 0,
            None if wish.delay is None else self.now + wish.delay,
            None if wish.at_utc is None else int(self.now + self.offset) + wish.at_utc,
            None if wish.within is None else self.now + wish.within,
            wish.is_preemptible,
            wish.is_preemptive,
        )

    def take_in(self, wish: Draft) -> None:
        waiting = [task for task in self.tasks.values() if task.state in WAITING]
        mine = [task for task in waiting if task.vehicle == wish.vehicle]
        is_full = len(mine) >= QUEUEING.capacity or len(waiting) >= QUEUEING.quota
        before = self.registry.all()
        refusal = refused(lambda: self.fleet.of(wish.vehicle).submit(wish, now=self.now))
        if refusal is None:
            assert not is_full
            self.last_id += 1
        else:
            assert refusal in REFUSALS
            assert is_full or wish.terms.after
            assert self.registry.all() == before
        self.follow()

    @precondition(lambda self: any(task.state not in TERMINAL for task in self.tasks.values()))
    @rule(data=st.data())
    def see_to_a_task(self, data: st.DataObject) -> None:
        """Cancel, kill, modify, withdraw or release one that is not over."""
        live = [task_id for task_id, task in self.tasks.items() if task.state not in TERMINAL]
        task = self.registry[TaskId(data.draw(st.sampled_from(live)))]
        if task.state is S.HELD:
            self.release(task, again=data.draw(st.booleans()))
            return
        actions = (
            ["cancel", "kill"] if task.state not in WAITING else ["cancel", "modify", "withdraw"]
        )
        match data.draw(st.sampled_from(actions)):
            case "modify":
                self.modify(task, data.draw(changes), after=data.draw(st.integers(0, task.id - 1)))
            case "withdraw":
                self.fleet.of(task.vehicle).room.withdraw(task, now=self.now)
            case action:
                tasks, kill = self.fleet.of(task.vehicle), action == "kill"
                tasks.cancel(task, kill=kill, reason=R.CANCELLED, actor="client", now=self.now)
        self.follow()

    def modify(self, task: Task, change: tuple[str, float], *, after: int) -> None:
        name, value = change
        value = {"after": after, "start_at": self.now + value, "deadline": self.now + value}.get(
            name, value
        )
        terms = replace(task.terms, **{name: value})  # type: ignore[arg-type]
        before = self.registry.all()
        tasks = self.fleet.of(task.vehicle)
        refusal = refused(lambda: tasks.modify(task, terms, actor="client", now=self.now))
        if refusal is not None:
            assert refusal in REFUSALS
            assert self.registry.all() == before

    def release(self, task: Task, *, again: bool) -> None:
        tasks, seen = self.fleet.of(task.vehicle), self.view(task.vehicle)
        before = self.registry.all()
        if refused(
            lambda: tasks.releases.release(
                task, again=again, may_continue=True, seen=seen, actor="client", now=self.now
            )
        ):
            assert self.registry.all() == before
        self.follow()

    @rule(
        vehicle=vehicles,
        action=st.sampled_from(["pause", "proceed", "proceed", "proceed", "clear", "stop"]),
        too=st.booleans(),
    )
    def see_to_a_queue(self, vehicle: int, action: str, too: bool) -> None:
        tasks, seen, before = self.fleet.of(vehicle), self.view(vehicle), self.registry.all()
        match action:
            case "pause":
                tasks.pause(R.OPERATOR, actor="client", now=self.now)
            case "clear":
                tasks.clear(begun_too=too, actor="client", now=self.now)
            case "stop":
                tasks.stop(clear=too, actor="client", now=self.now)
                assert tasks.active is None
            case _:
                if refused(lambda: tasks.proceed(seen, actor="client", now=self.now)):
                    assert self.registry.all() == before
        self.follow()

    # what time, clocks and vehicles do

    @rule()
    def all_goes_well(self) -> None:
        self.live_on(ticks=30, stands=True, answers=True)

    @rule(ticks=st.sampled_from([1, 2, 5]), stands=st.booleans(), answers=st.booleans())
    def live_on(self, ticks: int, stands: bool, answers: bool) -> None:
        waited = dict.fromkeys(VEHICLES, 0)
        for _ in range(ticks):
            self.now = round(self.now + TICK, 3)
            self.fleet.room.handle_deadline(now=self.now)
            self.follow()
            for vehicle in VEHICLES:
                tasks = self.fleet.of(vehicle)
                demand = tasks.step(self.view(vehicle, stands=stands), now=self.now)
                taken = demand.kind in (DemandKind.TAKE, DemandKind.DRIVE)
                self.is_ours[vehicle] = answers and taken
                self.follow()
                waits = stands and answers and self.waits_for_nothing(vehicle)
                waited[vehicle] = waited[vehicle] + 1 if waits else 0
                assert waited[vehicle] <= PATIENCE, "somebody waits who need not"

    @rule(what=st.sampled_from([-86_400.0, 86_400.0, -3.0, 3.0, "clean", "clean", "crash"]))
    def upset(self, what: float | str) -> None:
        """The wall clock jumps, or the server is started anew."""
        if isinstance(what, str):
            self.restart(ended_well=what == "clean")
            return
        self.offset += what
        self.fleet.room.set_wall_offset(self.offset, now=self.now)
        self.follow()

    def restart(self, *, ended_well: bool) -> None:
        tasks = self.registry.all()
        for task in tasks:
            due = self.due(task)
            came_late = task.state in WAITING and task.submitted_at < due <= self.now
            self.came[task.id] = due if came_late else task.submitted_at
        restored = Restored(
            tasks=tasks,
            next_id=self.last_id + 1,
            paused=dict(self.paused),
            ended_well=ended_well,
            wall_offset=self.offset,
        )
        running = [task.id for task in tasks if task.state in RUNNING]
        self.begin(restored)
        for vehicle in VEHICLES:  # an empty queue comes up paused, too, when it is first asked for
            assert self.fleet.of(vehicle).paused is not R.NONE or ended_well
        self.follow()
        for task_id in running:
            assert self.registry[task_id].state is S.HELD
            assert self.registry[task_id].reason is R.OUTCOME_UNKNOWN

    def view(self, vehicle: int, *, stands: bool = True) -> VehicleView:
        made = idle_vehicle(at=self.now)
        if self.is_ours[vehicle]:
            made = ours(at=self.now, still=stands)
        return replace(made, frame=Frame(1, 1, 0.0))

    # the model follows the journal, and nothing else

    def follow(self) -> None:
        for event in self.registry.take_events():
            self.apply(event)
        self.registry.durable = self.registry.recorded

    def apply(self, event: Event) -> None:
        match event:
            case TaskSubmitted(task=task):
                assert task.id not in self.tasks
                self.tasks[task.id] = task
                self.came[task.id] = self.now
            case TaskWithdrawn(task_id=task_id):
                assert self.tasks.pop(task_id).state in WAITING
            case TaskChanged(task_id=task_id, version=version, old=old, new=new):
                task = self.tasks[task_id]
                assert (task.state, version) == (old, task.version + 1)
                assert new in TRANSITIONS.get(old, {}), "terminal states are final"
                if old is S.SCHEDULED:
                    self.came[task_id] = max(self.came[task_id], self.due(task))
                if old is S.QUEUED and new is S.STARTING:
                    self.check_turn(task)
                if new is S.STARTING:
                    self.began[task.vehicle] = self.now
                if (new, event.reason) == (S.PAUSED, R.PREEMPTED):
                    self.interrupted = task
                self.tasks[task_id] = replace(
                    task,
                    state=new,
                    reason=event.reason,
                    version=version,
                    progress=event.progress,
                    changed_at=event.at,
                )
            case TaskModified(task_id=task_id, version=version):
                task = self.tasks[task_id]
                assert version == task.version + 1
                self.tasks[task_id] = replace(task, terms=event.terms, version=version)
            case TaskAdvanced():
                raise AssertionError("a wait has one leg")
            case QueuePaused(vehicle=vehicle, reason=reason):
                self.paused[vehicle] = reason
            case QueueContinued(vehicle=vehicle):
                self.paused.pop(vehicle, None)  # a halt of an idle rover ends with it, too

    def due(self, task: Task) -> float:
        utc = task.terms.start_utc
        from_utc = -inf if utc is None else utc - self.offset
        start = task.terms.start_at
        return max(from_utc, -inf if start is None else start)

    def may_interrupt(self, task: Task, running: Task) -> bool:
        """By what each was submitted or modified with, and nothing else."""
        if task.vehicle != running.vehicle or not running.terms.is_preemptible:
            return False
        if task.terms.is_preemptive:
            return not running.terms.is_preemptive or task.priority > running.priority
        return task.priority - running.priority >= QUEUEING.preemption_gap

    def waits_for_nothing(self, vehicle: int) -> bool:
        """Whether a task could begin or interrupt now, and has not yet."""
        mine = [task for task in self.tasks.values() if task.vehicle == vehicle]
        running = [task for task in mine if task.state in RUNNING]
        if vehicle in self.paused or any(task.state is S.HELD for task in mine):
            return False
        if not running:
            return any(task.state in (S.QUEUED, S.PAUSED) for task in mine)
        if self.now - self.began[vehicle] < QUEUEING.preemption_rest:
            return False
        ready = [task for task in mine if task.state is S.QUEUED]
        return any(self.may_interrupt(task, running[0]) for task in ready)

    def check_turn(self, task: Task) -> None:
        """The most urgent begins, unless it interrupts another."""
        assert task.vehicle not in self.paused, "nothing begins while the queue stands"
        assert self.now >= self.due(task)
        assert task.terms.deadline is None or self.now < task.terms.deadline
        ahead = self.tasks.get(task.terms.after)
        assert ahead is None or ahead.state is S.COMPLETED
        mine = [other for other in self.tasks.values() if other.vehicle == task.vehicle]
        assert not any(other.state is S.HELD for other in mine), "a held task blocks the queue"
        interrupted, self.interrupted = self.interrupted, None
        if interrupted is not None:
            assert self.may_interrupt(task, interrupted)
        else:
            assert self.order(task.vehicle)[0] == task.id
            paused = [other.id for other in mine if other.state is S.PAUSED]
            assert all(self.rank(task.id) < self.rank(other) for other in paused)

    def order(self, vehicle: int) -> list[int]:
        ready = [
            task_id
            for task_id, task in self.tasks.items()
            if task.vehicle == vehicle and task.state is S.QUEUED
        ]
        return sorted(ready, key=lambda task_id: (self.rank(task_id), task_id))

    def rank(self, task_id: int) -> Key:
        """Its own rank, or that of the most urgent one that waits for it, through others too."""
        task = self.tasks[task_id]
        came = self.came[task_id] if task.state in WAITING else task.submitted_at
        own: Key = (True, came - QUEUEING.aging * task.priority, came, task_id)
        if task.priority == 10:
            own = (False, 0.0, came, task_id)
        waiting = [
            other.id
            for other in self.tasks.values()
            if other.terms.after == task_id and other.state in WAITING
        ]
        return min([own, *map(self.rank, waiting)])

    @invariant()
    def the_tasks_are_what_the_journal_adds_up_to(self) -> None:
        kept = {task.id: task for task in self.registry.all()}
        assert {i: replace(t, progress=self.tasks[i].progress) for i, t in kept.items()} == (
            self.tasks
        )
        assert {v: self.fleet.of(v).paused for v in VEHICLES} == {
            v: self.paused.get(v, R.NONE) for v in VEHICLES
        }

    @invariant()
    def every_task_is_in_one_place(self) -> None:
        for vehicle in VEHICLES:
            tasks = self.fleet.of(vehicle)
            active = [] if tasks.active is None else [tasks.active.id]
            places = [*tasks.waiting, *active, *(task.id for task in tasks.suspended)]
            not_over = [
                task.id
                for task in self.tasks.values()
                if task.vehicle == vehicle and task.state not in TERMINAL
            ]
            assert sorted(places) == sorted(not_over)
            running = [i for i in not_over if self.tasks[i].state in RUNNING]
            assert running in ([], active)

    @invariant()
    def the_queues_are_in_order_and_bounded(self) -> None:
        for vehicle in VEHICLES:
            assert self.fleet.room.queue(vehicle).in_order() == self.order(vehicle)
            assert len(self.fleet.of(vehicle).waiting) <= QUEUEING.capacity
        assert sum(t.state in WAITING for t in self.tasks.values()) <= QUEUEING.quota

    @invariant()
    def what_waits_waits_for_a_reason(self) -> None:
        for task in self.tasks.values():
            ahead = self.tasks.get(task.terms.after)
            if task.state is S.BLOCKED:
                assert ahead is not None
                assert ahead.state not in TERMINAL
            if task.state is S.QUEUED:
                assert ahead is None or ahead.state is S.COMPLETED


TestLives = Lives.TestCase
TestLives.settings = settings(
    max_examples=100, stateful_step_count=70, deadline=None, derandomize=True
)
