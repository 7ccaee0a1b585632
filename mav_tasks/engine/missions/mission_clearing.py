"""Clears plans: a mission that is not being driven, fence and rally points."""

from dataclasses import dataclass

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

R = TaskReason


@dataclass(repr=False, eq=False)
class MissionClearing:
    """The handler of MISSION_CLEAR_ALL."""

    _vehicles: VehicleSide
    _submissions: Submissions
    _plans: Plans
    _answers: MissionAnswers

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
        number, actor, before = vehicle.system_id, str(sender.address), dict[int, Stored]()
        left = [each for each in kinds if self._plans.stored(number, each).plan_id]
        task = self._plans.task(vehicle) if MISSION in kinds else None

        def refuse(refusal: Rejection, *, now: float) -> None:
            self._answers.ack(sender, kind, result_of(refusal), refusal.reason)
            message_id = m.MissionClearAll.id
            self._answers.refused(sender, refusal, message_id=message_id, now=now)

        def clear_next(*, now: float) -> None:
            """Clear one type after the other, bounds on the vehicle first."""
            if not left:
                self._submissions.gate.hold(accept, undo, now=now)
            elif left[0] == MISSION:
                cleared(now=now)
            else:
                write_through(vehicle, left[0], (), cleared, refuse, now=now)

        def cleared(*, now: float) -> None:
            first = left.pop(0)
            before[first] = self._plans.stored(number, first)
            self._plans.keep(vehicle, first, NOTHING, actor=actor, now=now)
            clear_next(now=now)

        def accept(*, now: float) -> None:
            self._vehicles.mark_dirty(vehicle)
            self._plans.let_go(vehicle, task, R.CLEARED, actor=actor, now=now)
            self._answers.ack(sender, kind, MavMissionResult.ACCEPTED)

        def undo(*, now: float) -> None:
            for each, stored in before.items():
                self._plans.keep(vehicle, each, stored, actor=actor, now=now)
            self._answers.ack(sender, kind, MavMissionResult.ERROR)

        if task is not None and task.state in ACTIVE - AT_REST:
            words = f"clear: task {task.id} is being driven: pause or cancel it first"
            refuse(Rejection(R.WRONG_STATE, words), now=now)
        elif task is not None and is_late and task.state is TaskState.HELD:
            words = f"clear: delayed by the server; task {task.id} is held now: clear again"
            refuse(Rejection(R.STALE, words), now=now)
        else:
            clear_next(now=now)
