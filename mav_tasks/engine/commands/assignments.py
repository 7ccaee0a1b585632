"""Assigns the tasks that any vehicle may drive: at their submission, and again before they begin.

A task moves to another vehicle if its own fails before it has begun the task: if it is silent, has
stopped by its own failsafe or after a task that failed, or is low on battery, for GRACE seconds.
What a person halts stays where it is (``Lineup.keeps``): then the operator decides.
Nothing moves while this gateway's lease is not trusted. A task that has begun never moves.
"""

from collections.abc import Callable, Container, Iterable, Sequence
from math import inf, isnan, nan
from typing import NamedTuple

from mav_tasks.basics.errors import Rejection
from mav_tasks.config.settings import Settings
from mav_tasks.engine.commands.ability import ability_of, adapted, check_reach
from mav_tasks.engine.timers import Timers, Turn
from mav_tasks.engine.vehicles.joint_control import client_driving
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.kinds import GoTo, LocalPlace, Pose, SingleGoal
from mav_tasks.kinds.path import distance
from mav_tasks.tasks.driving.estimate import Estimate
from mav_tasks.tasks.driving.frames import local_place
from mav_tasks.tasks.driving.mission_sequencer import present_goal
from mav_tasks.tasks.fleet import Fleet
from mav_tasks.tasks.forecast import Forecast
from mav_tasks.tasks.goal import Goal, Plan, steps_of
from mav_tasks.tasks.lifecycle import WAITING, TaskReason, words_of
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Progress, Task, TaskId
from mav_tasks.tasks.vehicle_tasks import VehicleTasks
from mav_tasks.tasks.view import VehicleView

R = TaskReason

AT_ONCE = 1.0  # s; a rover that is free so soon is called free
HERE = 0.5  # m; a start so near is not worth a word
MOST_NAMED = 8  # other rovers named in one text


class Candidate(NamedTuple):
    """One rover as it stands, and what the task would cost it. SI units.

    ``blocker``: why no task could take control of it now, or NONE. ``inability``: why it cannot
    drive this task, "" if it can. ``battery``: 0 to 1; None: not known, which counts as good.
    ``free_in``: s until its queue is empty, and ``distance``: m from where it is then to the task's
    start, 0 if the task begins there; NaN: not known. ``waiting``: the length of its queue.
    """

    vehicle: int
    is_heard: bool = True
    paused: TaskReason = R.NONE
    is_held_ahead: bool = False
    is_driven_by_client: bool = False
    blocker: TaskReason = R.NONE
    is_full: bool = False
    inability: str = ""
    battery: float | None = None
    free_in: float = 0.0
    distance: float = 0.0
    speed: float = 1.0
    waiting: int = 0

    @property
    def begins_in(self) -> float:
        """Seconds until it could begin the task; inf if that is not known."""
        seconds = self.free_in + self.distance / self.speed
        return inf if isnan(seconds) else seconds


class Choice(NamedTuple):
    """The chosen rover, and why, in words."""

    vehicle: int
    words: str


def choose(candidates: Sequence[Candidate], *, least_battery: float) -> Choice:
    """Return the rover that would begin the task first; ``least_battery``: 0 to 1.

    Raise Rejection, which names why each rover cannot, if none can.
    """
    against = {each.vehicle: why_not(each, least_battery=least_battery) for each in candidates}
    able = [each for each in candidates if against[each.vehicle] is None]
    if not able:
        raise _refusal([each for each in against.values() if each is not None])
    best = min(able, key=_order)
    others = [
        f"rover {each.vehicle}: begins in {_seconds(each.begins_in)}"
        for each in sorted(able, key=_order)
        if each is not best
    ]
    others += [each.text for each in against.values() if each is not None]
    named = others[:MOST_NAMED] + (["and others"] if len(others) > MOST_NAMED else [])
    words = _praise(best)
    return Choice(best.vehicle, f"{words} ({'; '.join(named)})" if named else words)


def why_not(candidate: Candidate, *, least_battery: float) -> Rejection | None:
    """Return why a rover cannot be chosen, or None if it can."""
    reason, words = _obstacle(candidate, least_battery)
    return Rejection(reason, f"rover {candidate.vehicle}: {words}") if words else None


def is_low(battery: float | None, *, least_battery: float) -> bool:
    """Return whether a charge is below the bound; one that is not known counts as good."""
    return battery is not None and battery < least_battery


def _obstacle(it: Candidate, least_battery: float) -> tuple[TaskReason, str]:
    """Return the first obstacle, with its words; "" if there is none."""
    if it.inability:
        return R.NOT_SUPPORTED_BY_VEHICLE, it.inability
    if not it.is_heard:
        return R.VEHICLE_SILENT, "silent"
    if it.paused is R.STOPPED:
        return R.STOPPED, "STOP in force"
    if it.paused:
        return R.QUEUE_PAUSED, f"queue paused ({words_of(it.paused)})"
    if it.is_held_ahead:
        return R.HELD_AHEAD, "a task is held"
    if it.is_driven_by_client:
        return R.OTHER_CONTROLLER, "a client drives it"
    if is_low(it.battery, least_battery=least_battery):
        assert it.battery is not None
        return R.NOT_READY, f"battery {it.battery:.0%}, less than {least_battery:.0%}"
    if it.blocker:
        return it.blocker, words_of(it.blocker)
    if it.is_full:
        return R.QUEUE_FULL, "queue full"
    return R.NONE, ""


def _order(it: Candidate) -> tuple[float, int, float, int]:
    far = inf if isnan(it.distance) else it.distance
    return it.begins_in, it.waiting, far, it.vehicle


def _refusal(against: Sequence[Rejection]) -> Rejection:
    """Return the refusal of all rovers; its reason is one that may pass, if there is one."""
    if not against:
        return Rejection(R.VEHICLE_SILENT, "no rover is heard")
    passing = [each for each in against if each.reason != R.NOT_SUPPORTED_BY_VEHICLE]
    reason = (passing or against)[0].reason
    return Rejection(reason, f"no rover can: {'; '.join(each.text for each in against)}")


def _praise(it: Candidate) -> str:
    """Return what speaks for the chosen rover."""
    words = "free" if it.free_in < AT_ONCE else f"free in {_seconds(it.free_in)}"
    if it.distance > HERE:
        words += f", {it.distance:.0f} m away"
    return words if it.battery is None else f"{words}, battery {it.battery:.0%}"


def _seconds(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < inf else "an unknown time"


LOOK = 1.0  # s between two looks at the vehicles of waiting tasks
#: s for which a vehicle must have failed: longer than a radio takes to come back
GRACE = 5.0
MOST_AT_ONCE = 10  # tasks assigned again in one look; the others a second later: it takes time


class Assignments:
    """The choice of vehicles, and the tasks that may still move."""

    def __init__(
        self,
        vehicles: VehicleSide,
        fleet: Fleet,
        registry: TaskRegistry,
        timers: Timers,
        settings: Settings,
        *,
        is_open: Callable[[], bool],
    ) -> None:
        """``is_open`` returns whether new tasks are accepted; otherwise none moves, either."""
        self._vehicles = vehicles
        self._fleet = fleet
        self._registry = registry
        self._is_open = is_open
        self._timer = timers.timer(Turn.TASKS, self._look)
        self._may_move: dict[TaskId, None] = {}
        self._failing: dict[int, float] = {}  # by vehicle: since when
        #: by vehicle: as of a time, and of its last event
        self._foreseen: dict[int, tuple[tuple[float, int], Estimate]] = {}
        self.apply(settings)

    def __repr__(self) -> str:
        return f"Assignments({len(self._may_move)} tasks, failing: {self._failing})"

    def apply(self, settings: Settings) -> None:
        self._least_battery = settings.queueing.least_battery_percent / 100

    def choose(self, goal: Goal, *, now: float) -> Choice:
        """Return the vehicle for a new task. Raise Rejection if none can drive it."""
        vehicles = self._vehicles.all
        candidates = [self._candidate(each, goal, driven_by, now=now) for each in vehicles]
        return choose(candidates, least_battery=self._least_battery)

    def watch(self, tasks: Iterable[Task], *, now: float) -> None:
        """Let tasks move to other vehicles if their own fail before they begin."""
        chosen = [task.id for task in tasks if task.choice and task.state in WAITING]
        if chosen:
            self._may_move.update(dict.fromkeys(chosen))
            self._timer.set(min(self._timer.at, now + LOOK))

    def forget(self, vehicle: int, tasks: Container[TaskId]) -> None:
        """Forget a vehicle with its ``tasks``: they go to its next gateway with it."""
        self._failing.pop(vehicle, None)
        self._foreseen.pop(vehicle, None)
        self._may_move = {each: None for each in self._may_move if each not in tasks}

    def _look(self, *, now: float) -> None:
        """Look after the tasks that may move, each second while there are any."""
        found = map(self._registry.get, self._may_move)
        tasks = [task for task in found if task is not None and task.state in WAITING]
        self._may_move = dict.fromkeys(task.id for task in tasks)
        self._timer.set(now + LOOK if tasks else inf)
        if not self._vehicles.lease.is_trusted or not self._is_open():
            self._failing.clear()
            return
        whys = {each: self._why_failed(each, now=now) for each in {t.vehicle for t in tasks}}
        self._failing = {each: self._failing.get(each, now) for each, why in whys.items() if why}
        over = {each for each, since in self._failing.items() if now - since >= GRACE}
        movable = [task for task in tasks if task.vehicle in over and self._is_movable(task)]
        for task in movable[:MOST_AT_ONCE]:
            self._may_move[task.id] = self._may_move.pop(task.id)  # next time others come first
            self._assign_again(task, whys[task.vehicle], now=now)

    def _is_movable(self, task: Task) -> bool:
        """Return whether a task may move now: it is stored, and nobody wants it to stay."""
        tasks = self._fleet.of(task.vehicle)
        is_wanted_there = tasks.immediate == task.id or tasks.keeps(task)
        return self._registry.is_durable(task.id) and not is_wanted_there

    def _assign_again(self, task: Task, why: str, *, now: float) -> None:
        """Move a task to another vehicle; it stays if no other one can drive it."""
        candidates = [
            self._candidate(each, task.goal, _driven_alike, now=now)
            for each in self._vehicles.all
            if each.system_id != task.vehicle
        ]
        try:
            choice = choose(candidates, least_battery=self._least_battery)
        except Rejection:
            return
        words = f"rover {task.vehicle}: {why}; {choice.words}"
        self._fleet.room.assign(task, choice.vehicle, choice=words, now=now)

    def _why_failed(self, system_id: int, *, now: float) -> str:
        """Return why a vehicle cannot begin its tasks, or "" if it can, or if a task is held."""
        tasks, vehicle = self._fleet.get(system_id), self._vehicles.look_at(system_id)
        if tasks is None or tasks.is_held_ahead:
            return ""
        if vehicle is None:  # not heard in this run; another gateway may have begun its task
            is_lost = self._vehicles.has_listened(now=now) and not self._vehicles.lease.is_shared
            return "silent" if is_lost else ""
        if not vehicle.is_heard(now=now):
            return "silent"
        if tasks.paused:
            return words_of(tasks.paused)
        if is_low(vehicle.battery, least_battery=self._least_battery):
            return f"battery {vehicle.battery:.0%}"
        return ""

    def _candidate(
        self, vehicle: Vehicle, goal: Goal, driven: Callable[[Vehicle, Goal], Goal], *, now: float
    ) -> Candidate:
        """Return what a vehicle offers for a task; ``driven``: as it would drive it."""
        tasks, view = vehicle.tasks, vehicle.view(now=now)
        inability = ""
        try:
            present = present_goal(driven(vehicle, goal), Progress())
        except Rejection as refusal:
            inability, present = refusal.text, None
        empty = self._when_empty(tasks, now=now)
        capacity = vehicle.parts.settings.queueing.capacity
        return Candidate(
            vehicle.system_id,
            is_heard=vehicle.is_heard(now=now),
            paused=tasks.paused,
            is_held_ahead=tasks.is_held_ahead,
            is_driven_by_client=client_driving(vehicle.parts, now=now) is not None,
            blocker=R.NONE if present is None else tasks.blocker(view, present, now=now),
            is_full=tasks.room.count(vehicle.system_id) >= capacity,
            inability=inability,
            battery=vehicle.battery,
            free_in=empty.seconds,
            distance=_way_to(goal, empty.pose, view),
            speed=tasks.driving.speed,
            waiting=len(tasks.queue),
        )

    def _when_empty(self, tasks: VehicleTasks, *, now: float) -> Estimate:
        """Return when and where a vehicle's tasks are over; computed once for each batch."""
        as_of = now, self._registry.last_event_of(tasks.vehicle)
        known = self._foreseen.get(tasks.vehicle)
        if known is None or known[0] != as_of:
            empty = Forecast(tasks, self._registry, now=now).when_empty()
            known = self._foreseen[tasks.vehicle] = as_of, empty
        return known[1]


def check_any(goal: Goal, *, name: str = "") -> None:
    """Raise Rejection for a place that is another one for each vehicle; its text begins so."""
    for step in steps_of(goal):
        if isinstance(step, GoTo) and isinstance(step.place, LocalPlace):
            words = f"{name}metres from a local origin are another place for each rover:"
            raise Rejection(R.BAD_FRAME, f"{words} name the rover, or give latitude and longitude")
        if isinstance(step, GoTo) and step.place is None:
            raise Rejection(R.BAD_PARAMETER, f"{name}each rover has its own home: name the rover")


def driven_by(vehicle: Vehicle, goal: Goal) -> Goal:
    """Return a goal as a vehicle drives it. Raise Rejection if it cannot, or must not go there."""
    ability = ability_of(vehicle.persona, rover="it")
    steps = [each for each in steps_of(goal) if isinstance(each, GoTo)]
    for step in steps:
        check_reach(vehicle, step)
    if not isinstance(goal, Plan):
        return adapted(goal, ability)[0]
    if vehicle.where.leg_over_fence(goal.steps) is not None:
        raise Rejection(R.OUTSIDE_FENCE, "the path crosses the fence")
    steps_driven = tuple(adapted(step, ability)[0] for step in goal.steps)
    return Plan(steps_driven, goal.source, goal.first, goal.has_home, goal.has_options)


def _driven_alike(vehicle: Vehicle, goal: Goal) -> Goal:
    """Return a goal that a vehicle drives as it is. Raise Rejection if it does not.

    A waiting task has been adapted to its vehicle; adapted once more, it might be another task.
    """
    if driven_by(vehicle, goal) != goal:
        raise Rejection(R.NOT_SUPPORTED_BY_VEHICLE, "it would drive it differently")
    return goal


def _way_to(goal: Goal, pose: Pose | None, view: VehicleView) -> float:
    """Return the metres from a pose to where a task begins; 0 if it begins there; NaN: unknown."""
    first = next((step for step in steps_of(goal) if isinstance(step, SingleGoal)), None)
    if not isinstance(first, GoTo):
        return 0.0
    place = local_place(first.place, view.origin)
    return nan if pose is None or place is None else distance(pose, place)
