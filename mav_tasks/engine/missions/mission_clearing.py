"""Clears plans: a mission that is not being driven, fence and rally points."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from mav_tasks.engine.commands.submissions import Submissions
from mav_tasks.engine.missions.mission_answers import MissionAnswers
from mav_tasks.engine.missions.plan_items import result_of
from mav_tasks.engine.missions.plans import AT_REST, MISSION, NOTHING, STORED, Plans, Stored
from mav_tasks.engine.missions.write_through import write_through
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavMissionResult, MavMissionType
from mav_tasks.services.mission_receiver import Sender
from mav_tasks.tasks.lifecycle import ACTIVE, TaskReason, TaskState
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Task, TaskId

R = TaskReason


class _Cleared(NamedTuple):
    """Plans that a client cleared."""

    vehicle: Vehicle
    sender: Sender
    asked: int  # the plan type, or all of them
    before: tuple[tuple[int, Stored], ...]  # by plan type
    task: Task | None


@dataclass(repr=False, eq=False)
class MissionClearing:
    """The handler of MISSION_CLEAR_ALL."""

    _vehicles: VehicleSide
    _registry: TaskRegistry
    _submissions: Submissions
    _plans: Plans
    _answers: MissionAnswers

    def __post_init__(self) -> None:
        self._submissions.gate.knows(_Cleared, self._accept, self._undo)

    def clear(
        self, vehicle: Vehicle, sender: Sender, kind: int, *, is_late: bool, now: float
    ) -> None:
        """Clear plans of one type, or of all; answer once that is durable.

        ``is_late``: the message waited while the server was stalled. A held mission is then not
        cleared, because the next tasks would start.
        """
        kinds: list[int] = list(STORED) if kind == MavMissionType.ALL else [kind]
        if kinds[0] not in STORED:
            self._answers.ack(sender, kind, MavMissionResult.UNSUPPORTED)
            return
        task = self._plans.task(vehicle)
        if MISSION in kinds and task is not None and task.state in ACTIVE - AT_REST:
            self._answers.ack(sender, kind, MavMissionResult.DENIED)
            words = f"clear: task {task.id} is being driven: pause or cancel it first"
            self._refused(sender, vehicle, Rejection(R.WRONG_STATE, words), now=now)
            return
        if MISSION in kinds and task is not None and is_late and task.state is TaskState.HELD:
            self._answers.ack(sender, kind, MavMissionResult.DENIED)
            words = f"clear: delayed by the server; task {task.id} is held now: clear again"
            self._refused(sender, vehicle, Rejection(R.STALE, words), now=now)
            return
        stored = [k for k in kinds if self._plans.stored(vehicle.system_id, k).plan_id]
        self._forget(vehicle, sender, kind, stored, {}, now=now)

    def _forget(
        self,
        vehicle: Vehicle,
        sender: Sender,
        asked: int,
        kinds: Sequence[int],
        before: Mapping[int, Stored],
        *,
        now: float,
    ) -> None:
        """Clear one type after the other, bounds on the vehicle first; then hold the answer."""
        actor = str(sender.address)
        if not kinds:
            task = (
                self._registry.get(TaskId(before[MISSION].plan_id)) if MISSION in before else None
            )
            cleared = _Cleared(vehicle, sender, asked, tuple(before.items()), task)
            self._submissions.gate.hold(cleared, now=now)
            return
        first, rest = kinds[0], kinds[1:]

        def go_on(*, now: float) -> None:
            so_far = {**before, first: self._plans.stored(vehicle.system_id, first)}
            self._plans.keep(vehicle, first, NOTHING, actor=actor, now=now)
            self._forget(vehicle, sender, asked, rest, so_far, now=now)

        def refuse(refusal: Rejection, *, now: float) -> None:
            self._answers.ack(sender, asked, result_of(refusal), refusal.reason)
            self._refused(sender, vehicle, refusal, now=now)

        if first == MISSION:
            go_on(now=now)
        else:
            write_through(vehicle, first, (), go_on, refuse, now=now)

    def _accept(self, cleared: _Cleared, *, now: float) -> None:
        vehicle, task, actor = cleared.vehicle, cleared.task, str(cleared.sender.address)
        self._vehicles.mark_dirty(vehicle)
        self._plans.let_go(vehicle, task, R.CLEARED, actor=actor, now=now)
        self._answers.ack(cleared.sender, cleared.asked, MavMissionResult.ACCEPTED)

    def _undo(self, cleared: _Cleared, *, now: float) -> None:
        actor = str(cleared.sender.address)
        for kind, stored in cleared.before:
            self._plans.keep(cleared.vehicle, kind, stored, actor=actor, now=now)
        self._answers.ack(cleared.sender, cleared.asked, MavMissionResult.ERROR)

    def _refused(self, sender: Sender, vehicle: Vehicle, why: Rejection, *, now: float) -> None:
        self._answers.refused(sender, vehicle, why, message_id=m.MissionClearAll.id, now=now)
