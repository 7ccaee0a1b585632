"""Random lives of many tasks of one vehicle, beside a model that fits on one screen."""

from dataclasses import replace

import hypothesis.strategies as st
import pytest
from hypothesis import settings
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from mav_tasks.errors import Rejection
from mav_tasks.settings import Queueing, Settings
from mav_tasks.tasks.events import Event, TaskChanged, TaskSubmitted, TaskWithdrawn
from mav_tasks.tasks.fleet import Fleet
from mav_tasks.tasks.goal import Move
from mav_tasks.tasks.lifecycle import (
    ACTIVE,
    TERMINAL,
    TRANSITIONS,
    WAITING,
    TaskReason,
    TaskState,
)
from mav_tasks.tasks.outlook import position
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Pose, TaskId
from mav_tasks.tasks.view import DemandKind, ModeKind, VehicleView
from tests.unit.tasks.samples import draft, idle_vehicle, ours

CAPACITY = 4
LENGTH = 2.0
R = TaskReason


class TasksOfAVehicle(RuleBasedStateMachine):
    """What clients, the vehicle and the store may do to the tasks, in any order."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 10.0
        self.registry = TaskRegistry()
        limits = Settings(queueing=Queueing(capacity=CAPACITY))
        self.tasks = Fleet(self.registry, limits).of(1)
        self.along = 0.0
        self.armed = False
        # the model: what must be waiting, in order, and what is known of every task
        self.waiting: list[tuple[int, int]] = []  # (-priority, id)
        self.states: dict[int, TaskState] = {}
        self.gone: set[int] = set()

    # what clients do

    @rule(priority=st.integers(0, 10))
    def submit(self, priority: int) -> None:
        full = len(self.waiting) >= CAPACITY
        if full:
            with pytest.raises(Rejection):
                self.tasks.submit(draft(Move(LENGTH), priority=priority), now=self.now)
        else:
            task = self.tasks.submit(draft(Move(LENGTH), priority=priority), now=self.now)
            self.waiting.append((-priority, task.id))
        self.note()

    @precondition(lambda self: self.waiting)
    @rule(data=st.data())
    def withdraw(self, data: st.DataObject) -> None:
        _, task_id = data.draw(st.sampled_from(self.waiting))
        if not self.registry.is_durable(TaskId(task_id)):
            self.tasks.room.withdraw(self.registry[TaskId(task_id)], now=self.now)
        self.note()

    @rule()
    def pause(self) -> None:
        self.tasks.pause(R.OPERATOR, actor="client", now=self.now)
        self.note()

    @rule()
    def proceed(self) -> None:
        try:
            self.tasks.proceed(self.view(), actor="client", now=self.now)
        except Rejection:
            assert self.tasks.active is not None
        self.note()

    @rule(clear=st.booleans())
    def stop(self, clear: bool) -> None:
        self.tasks.stop(clear=clear, actor="client", now=self.now)
        assert self.tasks.active is None
        self.note()

    @rule()
    def hold(self) -> None:
        self.tasks.hold(R.LATE, now=self.now)
        self.note()

    # what the store does

    @rule()
    def commit(self) -> None:
        self.registry.durable = self.registry.recorded

    # what the vehicle does

    @rule(
        what=st.sampled_from(
            ["good", "good", "good", "arrived", "silent", "blind", "refuses", "manual", "disarmed"]
        ),
        ticks=st.sampled_from([1, 1, 3, 60]),
    )
    def live(self, what: str, ticks: int) -> None:
        for _ in range(ticks):
            self.now += 0.05
            self.move(what)
            active = self.tasks.active
            before = None if active is None else self.registry.is_durable(active.id)
            demand = self.tasks.step(self.view(what), now=self.now)
            moves = demand.kind is DemandKind.DRIVE and not demand.velocity.is_zero
            if moves:
                assert active is not None
                assert (active.state, before) == (TaskState.EXECUTING, True)
                assert not self.tasks.is_stopped
            self.armed = demand.kind in (DemandKind.TAKE, DemandKind.DRIVE)
            self.note()

    def move(self, what: str) -> None:
        active = self.tasks.active
        if active is None or active.progress.anchor is None:
            self.along = 0.0 if active is None else self.along
        elif active.state is TaskState.EXECUTING:
            end = active.progress.anchor.north + LENGTH
            self.along = end if what == "arrived" else min(end, self.along + 0.02)

    def view(self, what: str = "good") -> VehicleView:
        pose = Pose(self.along, 0.0, 0.0)
        seen = idle_vehicle(at=self.now, pose=pose)
        if self.armed:
            seen = ours(at=self.now, pose=pose, still=True)
        match what:
            case "silent":
                return replace(seen, heard=False)
            case "blind":
                return replace(seen, motion=None, still=False)
            case "refuses":
                return replace(seen, in_control=False, refusal=R.MODE_REFUSED)
            case "manual":
                return replace(seen, in_control=False, mode=ModeKind.MANUAL)
            case "disarmed":
                return replace(seen, in_control=False, armed=False)
        return seen

    # the model follows the journal, and nothing else

    def note(self) -> None:
        for event in self.registry.take_events():
            self.apply(event)

    def apply(self, event: Event) -> None:
        match event:
            case TaskSubmitted(task=task):
                assert task.id not in self.states
                self.states[task.id] = task.state
            case TaskWithdrawn(task_id=task_id):
                assert self.states.pop(task_id) is TaskState.QUEUED
                self.gone.add(task_id)
                self.forget(task_id)
            case TaskChanged(task_id=task_id, old=old, new=new):
                assert self.states[task_id] is old
                assert new in TRANSITIONS.get(old, {}), "terminal states are final"
                if new is TaskState.STARTING and old is TaskState.QUEUED:
                    assert min(self.waiting)[1] == task_id, "the most urgent begins"
                self.states[task_id] = new
                if new not in WAITING:
                    self.forget(task_id)

    def forget(self, task_id: int) -> None:
        self.waiting = [key for key in self.waiting if key[1] != task_id]

    @invariant()
    def no_task_is_lost_and_none_is_in_two_states(self) -> None:
        assert {task.id: task.state for task in self.registry.all()} == self.states
        assert not self.gone & set(self.states)

    @invariant()
    def the_queue_is_in_order_and_bounded(self) -> None:
        assert self.tasks.waiting == [task_id for _, task_id in sorted(self.waiting)]
        assert len(self.tasks.waiting) <= CAPACITY
        waits = [task_id for task_id, state in self.states.items() if state in WAITING]
        assert sorted(self.tasks.waiting) == sorted(waits)

    @invariant()
    def at_most_one_task_is_begun(self) -> None:
        active = [task_id for task_id, state in self.states.items() if state in ACTIVE]
        now = self.tasks.active
        assert active == ([] if now is None else [now.id])

    @invariant()
    def versions_count_the_changes(self) -> None:
        for task in self.registry.all():
            assert (task.version > 1) == (task.state is not TaskState.QUEUED)
            if task.state in TERMINAL:
                assert position(self.tasks, task) is None


TestTasksOfAVehicle = TasksOfAVehicle.TestCase
TestTasksOfAVehicle.settings = settings(
    max_examples=60, stateful_step_count=40, deadline=None, derandomize=True
)
