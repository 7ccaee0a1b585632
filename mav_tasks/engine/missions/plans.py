"""The stored plans of each vehicle: mission start, jumps to an item, and MISSION_CURRENT.

A mission at the autopilot's address is staged: a task that waits until it is started. If it is
started again after its end, it becomes a new task.
"""

from dataclasses import replace
from functools import partial
from math import inf
from typing import NamedTuple

from mav_tasks.basics.errors import Rejection
from mav_tasks.engine.clients.rights import OPERATOR, SUBMITTER, Rights
from mav_tasks.engine.missions.plan_items import fence_of, place_of, plan_of, steps_of
from mav_tasks.engine.missions.plan_table import MissionParseOptions
from mav_tasks.engine.services.missions import count_of, unpacked
from mav_tasks.engine.timers import Effect
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavMissionType
from mav_tasks.tasks.events import SERVER, PlanStored
from mav_tasks.tasks.fleet import Fleet
from mav_tasks.tasks.goal import Plan, number_of
from mav_tasks.tasks.lifecycle import (
    CONTINUE_FIRST,
    TERMINAL,
    WAITING,
    TaskReason,
    TaskState,
)
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.restored import StoredPlans
from mav_tasks.tasks.task import Draft, Submitter, Task, TaskId

R, S = TaskReason, TaskState

MISSION = MavMissionType.MISSION
STORED = (MavMissionType.MISSION, MavMissionType.FENCE, MavMissionType.RALLY)
#: MISSION_STATE, and that of tasks; others have not started
NO_MISSION, NOT_STARTED, ACTIVE, PAUSED, COMPLETE = range(1, 6)
STATES = {
    S.STARTING: ACTIVE,
    S.EXECUTING: ACTIVE,
    S.PAUSED: PAUSED,
    S.HELD: PAUSED,
    S.CANCELLING: PAUSED,
    S.COMPLETED: COMPLETE,
}
NO_PLAN = "there is no mission: upload one first"
STARTED_TWICE = 2.5  # s in which a second start counts as the first: MAVSDK sends two


class Stored(NamedTuple):
    """The id by which clients know a plan, and its items as uploaded, packed."""

    plan_id: int
    source: str


NOTHING = Stored(0, "")


class Started(NamedTuple):
    """A task that was started or resumed, and what undoes that if it is not stored in time."""

    task: Task
    undo: Effect


#: active, but not being driven: a stock autopilot, too, clears a mission in HOLD
AT_REST = frozenset({S.PAUSED, S.HELD})
CALLED_OFF = TERMINAL - {S.COMPLETED}


class Plans:
    """The store of all vehicles' plans, and the start of missions."""

    def __init__(self, registry: TaskRegistry, fleet: Fleet, *, restored: StoredPlans) -> None:
        self._registry = registry
        self._fleet = fleet
        self._stored: dict[tuple[int, int], Stored] = {}
        self._first: dict[int, int] = {}  # by vehicle: the item at which the next start begins
        #: the last start of each vehicle: by whom, of which task, and when
        self._started: dict[int, tuple[Submitter, TaskId, float]] = {}
        self.restore(restored)

    def restore(self, plans: StoredPlans) -> None:
        """Load stored plans, (id, source) by system id and kind."""
        for (system_id, kind), stored in plans.items():
            self._set(system_id, kind, Stored(*stored))

    def forget(self, vehicle: int) -> None:
        """Forget a vehicle's plans, which are stored."""
        for kind in STORED:
            self._stored.pop((vehicle, kind), None)
        self._first.pop(vehicle, None)
        self._started.pop(vehicle, None)

    def stored(self, vehicle: int, kind: int) -> Stored:
        """Return a vehicle's mission, fence or rally points."""
        return self._stored.get((vehicle, kind), NOTHING)

    def shown(self, vehicle: Vehicle) -> Task | None:
        """Return the mission that clients are shown: the active one, else the staged one."""
        active = vehicle.tasks.active
        if active is not None and isinstance(active.goal, Plan):
            return active
        return self.task(vehicle)

    def task(self, vehicle: Vehicle) -> Task | None:
        """Return the task of the staged mission, None if it is not remembered."""
        return self._registry.get(TaskId(self.stored(vehicle.system_id, MISSION).plan_id))

    def keep(self, vehicle: Vehicle, kind: int, stored: Stored, *, actor: str, now: float) -> None:
        """Store a plan in place of the one before; NOTHING removes it."""
        before = self.stored(vehicle.system_id, kind)
        if stored == before:
            return
        if kind == MISSION and stored.source != before.source:
            vehicle.parts.forget_start()
        self._set(vehicle.system_id, kind, stored)
        self._registry.record(PlanStored(vehicle.system_id, kind, *stored, actor, now))

    def _set(self, system_id: int, kind: int, stored: Stored) -> None:
        self._stored[system_id, kind] = stored
        bounds = self._fleet.of(system_id).bounds
        if kind == MavMissionType.FENCE:
            bounds.fence = fence_of(unpacked(stored.source))
        elif kind == MavMissionType.RALLY:
            bounds.rally = tuple(map(place_of, unpacked(stored.source)))

    def end_replaced(self, vehicle: Vehicle, *, is_started: bool, actor: str, now: float) -> None:
        """End the missions that the staged one has replaced, as on an autopilot.

        ``is_started``: the staged one is started; else it was uploaded. Then one that drives, or
        goes on by itself, drives on until that start, and nothing else may begin in its place.
        """
        last = self.stored(vehicle.system_id, MISSION).plan_id
        for task in vehicle.tasks.unfinished:
            is_at_rest = task.state is S.PAUSED and bool(vehicle.tasks.paused)
            ends = is_started or is_at_rest or task.state in WAITING
            if ends and is_of_autopilot(task) and task.id != last:
                vehicle.joint.cancel(task, kill=False, reason=R.REPLACED, actor=actor, now=now)

    def let_go(self, vehicle: Vehicle, plan_id: int, *, actor: str, now: float) -> None:
        """Drop a removed mission: cancel it unless it drives; nobody could resume it."""
        task = self._registry.get(TaskId(plan_id))
        if task is not None and task.state in WAITING | AT_REST:
            vehicle.joint.cancel(task, kill=False, reason=R.CLEARED, actor=actor, now=now)
        self._first.pop(vehicle.system_id, None)

    def begin_at(self, vehicle: Vehicle, first: int) -> None:
        """Let the next start begin at this item; 0 is the first."""
        self._first[vehicle.system_id] = first

    def undo_of_jump(self, vehicle: Vehicle) -> Effect:
        """Return what undoes the jump that comes next, if it is not stored in time."""
        going, chosen = self._going(vehicle), self._first.get(vehicle.system_id)

        def undo(*, now: float) -> None:
            if going is not None:
                self._go_back(vehicle, going[0], now=now)
            elif chosen is None:
                self._first.pop(vehicle.system_id, None)
            else:
                self.begin_at(vehicle, chosen)

        return undo

    def _go_back(self, vehicle: Vehicle, before: Task, *, now: float) -> None:
        task = self._registry.get(before.id)
        if task is not None and task.state not in TERMINAL:
            vehicle.tasks.go_on_at(task, before.progress, now=now)

    # starting and jumping

    def check_start(self, rights: Rights, vehicle: Vehicle, submitter: Submitter) -> None:
        """Raise Rejection unless a client may start the vehicle's plans, or jump in them."""
        rights.require(SUBMITTER, "start a plan")
        if vehicle.tasks.paused:
            rights.require(OPERATOR, "start a plan in a paused queue")
        if vehicle.armed and vehicle.parts.is_manual:
            rights.require(OPERATOR, "end manual control")
        for task in (vehicle.tasks.active, self.task(vehicle)):
            if task is not None and isinstance(task.goal, Plan):
                rights.require_own(task, submitter, "start that plan")

    def start(
        self, rights: Rights, vehicle: Vehicle, submitter: Submitter, *, first: int, now: float
    ) -> Started | Draft:
        """Start or resume the staged mission; or resume an active plan, if no staged one is new.

        Return it; or, if it is over, the draft of a new task: submit that, then call
        ``restarted``. Raise Rejection if there is nothing to start, or it must not start now.
        """
        if vehicle.tasks.is_stopped:
            raise Rejection(R.STOPPED, CONTINUE_FIRST)
        vehicle.parts.check_not_manual(now=now)
        stored = self.stored(vehicle.system_id, MISSION)
        active, task = vehicle.tasks.active, self.task(vehicle)
        undo = partial(self._not_started, vehicle, vehicle.tasks.paused)
        is_fresh = task is not None and task.state in WAITING and task.terms.is_staged
        is_other = active and active.id != stored.plan_id and isinstance(active.goal, Plan)
        if active and is_other and not is_fresh:
            self._set_going(rights, vehicle, active, submitter, now=now)
            return Started(active, partial(undo, active))
        _check_state(task)
        count = count_of(stored.source)
        if not count:
            raise Rejection(R.NOT_FOUND, NO_PLAN)
        if first >= count:
            words = f"param1 first item {first}: the plan has {count} items"
            raise Rejection(R.BAD_PARAMETER, words, param=1)
        if task is not None and task.state not in CALLED_OFF and not vehicle.tasks.paused:
            # repeated, perhaps in another way: it is the start that was just requested
            by, task_id, at = self._started.get(vehicle.system_id, (None, 0, -inf))
            if (by, task_id) == (submitter, task.id) and now - at <= STARTED_TWICE:
                return Started(task, partial(undo, task))
        chosen = self._first.pop(vehicle.system_id, 0)
        first = first or chosen
        if task is None or task.state in TERMINAL:
            return self._again(vehicle, stored, submitter, first=first, now=now)
        if first:
            vehicle.tasks.skip_to(task, first, now=now)
        self._set_going(rights, vehicle, self._registry[task.id], submitter, now=now)
        return Started(task, partial(undo, task, has_jumped=bool(first)))

    def _set_going(
        self, rights: Rights, vehicle: Vehicle, task: Task, by: Submitter, *, now: float
    ) -> None:
        """Resume an active mission and its queue; start a waiting one, even in a paused queue.

        A held one drives its remainder: who starts it has decided that it goes on. One that a
        submitter starts waits as its other tasks do: it takes the vehicle from nobody.
        """
        joint, tasks, actor = vehicle.joint, vehicle.tasks, str(by)
        may_resume = rights.reach(OPERATOR)
        _check_state(task)
        self._started[vehicle.system_id] = by, task.id, now
        if task.state is S.HELD:
            joint.release(task, again=False, may_continue=may_resume, actor=actor, now=now)
        if task == tasks.active or task.state is S.HELD:
            if may_resume and (task.state is not S.HELD or tasks.paused):
                joint.go_on(actor=actor, now=now)
            return
        if is_of_autopilot(task):
            self.end_replaced(vehicle, is_started=True, actor=actor, now=now)
        if task.terms.is_staged:
            tasks.modify(task, replace(task.terms, is_staged=False), actor=actor, now=now)
        if may_resume and (tasks.paused or tasks.is_held_ahead or joint.state(now=now).is_led):
            joint.give_way_to(task, actor=actor, now=now)
        joint.wake(now=now)

    def _not_started(
        self,
        vehicle: Vehicle,
        paused: TaskReason,
        before: Task,
        *,
        has_jumped: bool = False,
        now: float,
    ) -> None:
        """Undo a start: what it let go stands again, and the queue is paused as before."""
        was_at_rest = before.state is S.HELD or before.terms.is_staged
        was_at_rest |= before.state is S.PAUSED and bool(paused)
        self._started.pop(vehicle.system_id, None)
        if has_jumped:
            self._go_back(vehicle, before, now=now)
        tasks, task = vehicle.tasks, self._registry.get(before.id)
        if task is not None and task.state in WAITING and before.terms.is_staged:
            terms = replace(task.terms, is_staged=True)
            tasks.modify(task, terms, actor=SERVER, now=now)
        elif task is not None and task == tasks.active and was_at_rest:
            vehicle.joint.pause(actor=SERVER, now=now)
        if paused and not tasks.paused:
            tasks.pause_queue(paused, now=now)

    def restarted(self, rights: Rights, vehicle: Vehicle, task: Task, *, now: float) -> None:
        """Start a mission that was submitted again; its plan id becomes the new task's id."""
        stored = self.stored(vehicle.system_id, MISSION)._replace(plan_id=task.id)
        self.keep(vehicle, MISSION, stored, actor=str(task.submitter), now=now)
        self._set_going(rights, vehicle, task, task.submitter, now=now)

    def _again(
        self, vehicle: Vehicle, stored: Stored, submitter: Submitter, *, first: int, now: float
    ) -> Draft:
        manner = MissionParseOptions.of(
            vehicle.persona, is_staged=True, driving=vehicle.parts.settings.driving
        )
        items = unpacked(stored.source)
        steps = steps_of(items, count=len(items), manner=manner)
        wanted = plan_of(items, steps, has_home=manner.has_home, now=now)
        plan = replace(wanted.plan, first=first)
        command, terms = MavCmd.MISSION_START, replace(wanted.terms, is_cruising=True)
        return Draft(vehicle.system_id, command, plan, submitter, terms=terms)

    def go_on_with(self, vehicle: Vehicle, seq: int, *, now: float) -> Task | None:
        """Jump to an item of the mission and return its task; None: the next start begins there.

        Raise Rejection if there is no such item.
        """
        going = self._going(vehicle)
        stored = self.stored(vehicle.system_id, MISSION)
        count = len(going[1].steps) if going else count_of(stored.source)
        if not count:
            raise Rejection(R.NOT_FOUND, NO_PLAN)
        if seq >= count:
            last = self._number_of(vehicle, count - 1)
            words = f"item {self._number_of(vehicle, seq)}: the last item is {last}"
            raise Rejection(R.BAD_PARAMETER, NO_PLAN if last < 1 else words, param=1)
        if not going:
            self.begin_at(vehicle, seq)
            return None
        vehicle.tasks.skip_to(going[0], seq, now=now)
        return going[0]

    def begins_with(self, vehicle: Vehicle, seq: int) -> str:
        """Return the text to a client that chose the item at which the next start begins."""
        return f"The mission will start with item {self._number_of(vehicle, seq)}"

    def _going(self, vehicle: Vehicle) -> tuple[Task, Plan] | None:
        """Return the mission that clients are shown, unless it is over."""
        task = self.shown(vehicle)
        if task is None or task.state in TERMINAL or not isinstance(task.goal, Plan):
            return None
        return task, task.goal

    def _number_of(self, vehicle: Vehicle, seq: int) -> int:
        """Return the number of an item in the file of the mission that clients are shown."""
        going = self._going(vehicle)
        has_home = going[1].has_home if going else vehicle.persona.has_home_item
        return number_of(seq, has_home=has_home)

    # showing

    def current(self, vehicle: Vehicle, *, seq: int | None = None) -> m.MissionCurrent:
        """Return MISSION_CURRENT; ``seq`` replaces the number of the current item."""
        task, chosen = self.shown(vehicle), self._first.get(vehicle.system_id)
        mission, fence, rally = (self.stored(vehicle.system_id, kind) for kind in STORED)
        plan_id, count, at = mission.plan_id, count_of(mission.source), chosen or 0
        state = NOT_STARTED
        if task is not None and isinstance(task.goal, Plan):
            plan_id, count = task.id, len(task.goal.steps)
            if chosen is None or task.state not in TERMINAL:  # else that is for the next start
                state = STATES.get(task.state, NOT_STARTED)
                at = min(task.goal.present_step(task.progress.step), max(count - 1, 0))
        return m.MissionCurrent(
            at if seq is None else seq,
            count,
            state if count else NO_MISSION,
            0,
            plan_id,
            fence.plan_id,
            rally.plan_id,
        )


def is_of_autopilot(task: Task) -> bool:
    """Return whether a task is a mission of the autopilot's address, which has one at a time."""
    return isinstance(task.goal, Plan) and task.terms.is_cruising


def _check_state(task: Task | None) -> None:
    """Raise Rejection if a mission is being cancelled."""
    if task is not None and task.state is S.CANCELLING:
        raise Rejection(R.QUEUE_PAUSED, f"task {task.id} is being cancelled")
