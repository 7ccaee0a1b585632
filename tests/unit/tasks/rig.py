"""Tasks in virtual time, with a store that keeps everything at once, and rovers made by hand."""

from collections.abc import Callable
from dataclasses import replace
from math import cos, sin

from mav_tasks.settings import Queueing, Settings
from mav_tasks.tasks.driving.guidance import ZERO, Motion, Velocity, wrap
from mav_tasks.tasks.events import Event, TaskChanged
from mav_tasks.tasks.fleet import Fleet
from mav_tasks.tasks.goal import GlobalPlace, Goal
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Draft, Frame, Pose, Task, TaskId, Terms
from mav_tasks.tasks.vehicle_tasks import VehicleTasks
from mav_tasks.tasks.view import Demand, DemandKind, VehicleView
from tests.unit.tasks.samples import FORWARD_2, ORIGIN, draft, idle_vehicle, ours

S = TaskState
SETTINGS = Settings()
TICK = SETTINGS.watch.setpoint_period
BY = "somebody"  # who asks for things

View = Callable[[float], VehicleView]


def with_queueing(queueing: Queueing) -> Settings:
    return replace(SETTINGS, queueing=queueing)


def idle(now: float) -> VehicleView:
    return idle_vehicle(at=now)


def in_control(now: float) -> VehicleView:
    """Ours, at rest at the origin."""
    return ours(at=now, still=True)


def at(north: float, *, still: bool = False, yaw: float = 0.0) -> View:
    return lambda now: ours(at=now, pose=Pose(north, 0.0, yaw), still=still)


class Rig:
    """A fleet, and one vehicle's tasks driven by views of it."""

    def __init__(self, *, settings: Settings = SETTINGS, now: float = 10.0) -> None:
        self.now = now
        self.settings = settings
        self.registry = TaskRegistry()
        self.fleet = Fleet(self.registry, settings)
        self.keeps = True

    @property
    def tasks(self) -> VehicleTasks:
        return self.fleet.of(1)

    def submit(
        self,
        goal: Goal = FORWARD_2,
        *,
        priority: int = 5,
        vehicle: int = 1,
        terms: Terms | None = None,
    ) -> Task:
        wish = draft(goal, priority=priority, vehicle=vehicle)
        return self.take_in(wish if terms is None else replace(wish, terms=terms))

    def take_in(self, wish: Draft) -> Task:
        task = self.fleet.of(wish.vehicle).submit(wish, now=self.now)
        self.keep()
        return task

    def keep(self) -> None:
        if self.keeps:
            self.registry.durable = self.registry.recorded

    def pass_time(self, seconds: float) -> None:
        self.now = round(self.now + seconds, 6)
        self.fleet.room.handle_deadline(now=self.now)
        self.keep()

    def step(self, view: View) -> Demand:
        """A tick later, look and step."""
        self.pass_time(TICK)
        demand = self.tasks.step(view(self.now), now=self.now)
        self.keep()
        return demand

    def steps(self, view: View, *, seconds: float) -> Demand:
        demand = self.step(view)
        for _ in range(round(seconds / TICK) - 1):
            demand = self.step(view)
        return demand

    def executing(self, goal: Goal = FORWARD_2) -> "Rig":
        """Go as far as EXECUTING, and begin the story there."""
        self.submit(goal)
        self.step(idle)
        self.step(in_control)
        assert self.state(1) is S.EXECUTING
        self.story()
        return self

    def drive(self, length: float) -> None:
        """Let the vehicle be seen further and further along."""
        steps = 40
        for step in range(1, steps + 1):
            self.step(at(length * step / steps))

    def task(self, task_id: int) -> Task:
        return self.registry[TaskId(task_id)]

    def state(self, task_id: int) -> TaskState:
        return self.task(task_id).state

    def states(self) -> list[TaskState]:
        """The states of all tasks, by their ids."""
        return [task.state for task in self.registry.all()]

    def modify(self, task_id: int, **changes: float | bool | None) -> Task:
        """Change one of a task's terms."""
        task = self.task(task_id)
        terms = replace(task.terms, **changes)  # type: ignore[arg-type]
        self.fleet.of(task.vehicle).modify(task, terms, actor=BY, now=self.now)
        self.keep()
        return self.task(task_id)

    def cancel(self, task_id: int, *, kill: bool = False) -> None:
        task = self.task(task_id)
        tasks = self.fleet.of(task.vehicle)
        tasks.cancel(task, kill=kill, reason=TaskReason.CANCELLED, actor=BY, now=self.now)
        self.keep()

    def story(self) -> list[tuple[int, TaskState, TaskReason]]:
        """The changes of tasks since the last call."""
        return story_of(self.registry.take_events())

    def restarted(self, *, paused: dict[int, TaskReason] | None = None, **how: float) -> "Rig":
        """The same tasks in a server begun anew."""
        after = Rig(settings=self.settings, now=self.now)
        tasks = self.registry.all()
        last = max((task.id for task in tasks), default=0)
        restored = Restored(
            tasks=tasks,
            next_id=last + 1,
            paused=paused or {},
            ended_well=bool(how.get("ended_well", True)),
            idle=how.get("idle", 0.0),
            wall_offset=how.get("wall_offset", 0.0),
        )
        after.fleet.restore(restored, now=self.now)
        after.keep()
        return after


def story_of(events: list[Event]) -> list[tuple[int, TaskState, TaskReason]]:
    return [(e.task_id, e.new, e.reason) for e in events if isinstance(e, TaskChanged)]


class Rover:
    """A point that turns and drives exactly as it is told, and gives control when asked."""

    def __init__(self, pose: Pose = ORIGIN, *, frame: Frame | None = None) -> None:
        self.pose = pose
        self.velocity = ZERO
        self.is_ours = False
        self.frame = frame
        self.home: GlobalPlace | None = None

    def view(self, now: float) -> VehicleView:
        made = ours if self.is_ours else idle_vehicle
        motion = Motion(self.pose, self.velocity.forward, 0.0, self.velocity.yaw_rate, now)
        return replace(
            made(at=now),
            motion=motion,
            still=self.velocity.is_zero,
            frame=self.frame,
            home=self.home,
        )

    def follow(self, demand: Demand, *, seconds: float) -> None:
        if demand.kind in (DemandKind.TAKE, DemandKind.DRIVE):
            self.is_ours = True
        elif demand.kind in (DemandKind.HAND_BACK, DemandKind.STOP, DemandKind.HALT):
            self.is_ours = False
        self.velocity = demand.velocity if self.is_ours else ZERO
        self.move(self.velocity, seconds=seconds)

    def move(self, velocity: Velocity, *, seconds: float) -> None:
        pose = self.pose
        middle = pose.yaw + velocity.yaw_rate * seconds / 2
        self.pose = Pose(
            pose.north + velocity.forward * seconds * cos(middle),
            pose.east + velocity.forward * seconds * sin(middle),
            wrap(pose.yaw + velocity.yaw_rate * seconds),
        )


def run(rig: Rig, rover: Rover, *, seconds: float) -> None:
    """Let the rover do what the tasks of vehicle 1 demand."""
    for _ in range(round(seconds / TICK)):
        rover.follow(rig.step(rover.view), seconds=TICK)


def run_until(
    rig: Rig, rover: Rover, happened: Callable[[], bool], *, within: float = 120.0
) -> None:
    """The same until something has happened."""
    end = rig.now + within
    while not happened():
        assert rig.now < end, f"not within {within} s: {rig.tasks!r}, at {rover.pose}"
        rover.follow(rig.step(rover.view), seconds=TICK)
