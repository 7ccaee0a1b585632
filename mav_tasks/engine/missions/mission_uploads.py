"""Decides about whole uploads: refuses, submits or stores them; acknowledges them when durable.

The autopilot's address has one mission, which is staged until it is started, as on an autopilot.
The task server's address takes any number; each is queued at once. Fence and rally points belong to
the vehicle, at either address.
"""

from dataclasses import dataclass, replace
from functools import partial
from hashlib import blake2b
from zlib import crc32

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.commands.submissions import Submissions
from mav_tasks.engine.missions.fence_items import fence_for_vehicle, fence_of
from mav_tasks.engine.missions.item_check import PlanCheck
from mav_tasks.engine.missions.mission_answers import MissionAnswers
from mav_tasks.engine.missions.plan_items import ParsedMission, result_of, skipped
from mav_tasks.engine.missions.plans import MISSION, Plans, Stored, is_of_autopilot
from mav_tasks.engine.missions.write_through import write_through
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT
from mav_tasks.mavlink.enums import MavCmd, MavMissionResult, MavMissionType, MavSeverity
from mav_tasks.services.mission_item import packed
from mav_tasks.services.mission_receiver import (
    MissionReceiver,
    RequestForm,
    Sender,
    Upload,
)
from mav_tasks.tasks.goal import describe
from mav_tasks.tasks.lifecycle import ACTIVE, TERMINAL, TaskReason
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Draft, Marks, Submitter, Task

R = TaskReason

#: reason of an upload that the receiver itself ended, by its MAV_MISSION_RESULT
ENDED = {
    MavMissionResult.DENIED: R.WRONG_STATE,  # another client uploads
    MavMissionResult.NO_SPACE: R.QUEUE_FULL,
    MavMissionResult.OPERATION_CANCELLED: R.WRONG_STATE,
}


def refusal_of(result: int, words: str) -> Rejection:
    """Return why the receiver itself ended an upload with this MAV_MISSION_RESULT."""
    reason = ENDED.get(MavMissionResult(result), R.BAD_PARAMETER)
    return Rejection(reason, f"upload: {words or 'an item cannot be read'}")


def draft_of(vehicle: int, wanted: ParsedMission, client: GcsClient, sender: Sender) -> Draft:
    """Return the submission of a whole upload; two of one content differ by their nonces."""
    what = f"{sender.addressed} {wanted.plan.source}".encode()
    marks = Marks(wanted.nonce, blake2b(what, digest_size=9).hexdigest())
    submitter = client.submitter(sender.address)
    return Draft(vehicle, MavCmd.MISSION_START, wanted.plan, submitter, wanted.terms, marks)


class UploadSession:
    """The receiver of uploads to one address, and their item check."""

    def __init__(self, check: PlanCheck, form: RequestForm) -> None:
        self.check = check
        self.receiver = MissionReceiver(check=check, form=form)


@dataclass(repr=False, eq=False)
class MissionUploads:
    """The decision about whole uploads, and the answers to their clients."""

    _gcs: GcsSide
    _vehicles: VehicleSide
    _registry: TaskRegistry
    _submissions: Submissions
    _plans: Plans
    _answers: MissionAnswers

    def flush(
        self,
        desk: UploadSession,
        vehicle: Vehicle,
        *,
        now: float,
        refusal: Rejection | None = None,
    ) -> None:
        """Send a session's messages, and decide about its complete uploads.

        ``refusal``: why the upload just decided about was refused.
        """
        outgoing, uploads = desk.receiver.take()
        for told in outgoing:
            if isinstance(told.message, m.MissionAck) and told.message.type:
                ended = refusal_of(told.message.type, told.why)
                why = ended if told.why else refusal or desk.check.take_refusal() or ended
                told.message.opaque_id = why.reason
                self._answers.send(told)
                self.refused(told.sender, vehicle, why, now=now)
            else:
                self._answers.send(told)
        for upload in uploads:
            self._vehicles.mark_dirty(vehicle)
            self._decide(desk, vehicle, upload, now=now)

    def _decide(self, desk: UploadSession, vehicle: Vehicle, upload: Upload, *, now: float) -> None:
        try:
            self._submissions.check_open()
            if upload.mission_type != MISSION:
                self._replace(desk, vehicle, upload, now=now)
            elif self._is_nothing(vehicle, upload):
                self._check_not_begun(vehicle)
                client = self._client(upload.sender)
                self._check_replaced(client, vehicle, client.submitter(upload.sender.address))
                self._replace(desk, vehicle, upload._replace(items=()), now=now)
            else:
                self._take_in(desk, vehicle, upload, now=now)
        except Rejection as refusal:
            self._refuse(desk, vehicle, refusal, now=now)

    def _decide_late(
        self, desk: UploadSession, vehicle: Vehicle, upload: Upload, *, now: float
    ) -> None:
        """Decide about an upload that was held back."""
        if self._answers.client(upload.sender) is None:
            self._refuse(desk, vehicle, Rejection(R.WRONG_STATE, "the client has gone"), now=now)
        else:
            self._decide(desk, vehicle, upload, now=now)

    def _check_not_begun(self, vehicle: Vehicle) -> None:
        task = self._plans.task(vehicle)
        if task is not None and task.state in ACTIVE:
            raise Rejection(R.NOT_ALLOWED, f"task {task.id} has started: cancel it first")

    def _is_nothing(self, vehicle: Vehicle, upload: Upload) -> bool:
        """Whether a mission is empty: no item, or only ArduPilot's home item."""
        is_staged = upload.sender.addressed.component_id == AUTOPILOT
        return len(upload.items) <= (vehicle.persona.has_home_item and is_staged)

    def _take_in(
        self, desk: UploadSession, vehicle: Vehicle, upload: Upload, *, now: float
    ) -> None:
        """Submit a mission as a task, staged or queued."""
        sender = upload.sender
        is_staged = sender.addressed.component_id == AUTOPILOT
        wanted = desk.check.plan_of(upload.items, now=now)
        terms = replace(wanted.terms, is_staged=is_staged, is_cruising=is_staged)
        wanted = wanted._replace(terms=terms, nonce=0 if is_staged else wanted.nonce)
        client = self._client(sender)
        draft = draft_of(vehicle.system_id, wanted, client, sender)
        # ``begun_at``: a long plan may come again later than submissions are remembered
        known = None
        if not is_staged:
            known = self._submissions.known_plan(draft, begun_at=upload.begun_at, now=now)
        if known is not None:
            desk.receiver.finish(MavMissionResult.ACCEPTED, opaque_id=known, now=now)
            self.flush(desk, vehicle, now=now)
            words = f"repeated plan, no new task: see task {known}"
            self._answers.tell(sender, vehicle, words, now=now)
            return
        again = partial(self._decide_late, desk, vehicle, upload)
        refuse = partial(self._refuse, desk, vehicle)
        if self._submissions.questions.hold(draft.terms.after, again, refuse, now=now):
            return
        halts = vehicle.tasks.halts
        if not is_staged and upload.begun_at < halts.at:
            raise Rejection(R.STALE, f"{halts.words} came during the upload: upload it again")
        before = self._plans.stored(vehicle.system_id, MISSION)
        if is_staged:
            self._check_replaced(client, vehicle, draft.submitter)
        task = self._submissions.submit_plan(client.rights, vehicle, draft, now=now)
        if is_staged:
            self._plans.keep(
                vehicle, MISSION, Stored(task.id, upload.items), actor=str(sender.address), now=now
            )
        accept = partial(self._accept, desk, vehicle, sender, task)

        def withdraw(*, now: float) -> None:
            self._vehicles.mark_dirty(vehicle)
            self._submissions.take_back(vehicle, task, now=now)
            if is_staged:
                self._plans.keep(vehicle, MISSION, before, actor=str(sender.address), now=now)
            refusal = Rejection(R.STORE_UNAVAILABLE, "not stored in time: not accepted")
            self._refuse(desk, vehicle, refusal, now=now)

        self._submissions.gate.hold(accept, withdraw, now=now)

    def _accept(
        self, desk: UploadSession, vehicle: Vehicle, sender: Sender, task: Task, *, now: float
    ) -> None:
        self._vehicles.get(vehicle.system_id)  # marks it dirty: a task may start
        desk.receiver.finish(MavMissionResult.ACCEPTED, opaque_id=task.id, now=now)
        self.flush(desk, vehicle, now=now)
        what = "queued"
        if task.terms.is_staged:
            actor = str(sender.address)
            self._plans.end_replaced(vehicle, is_started=False, actor=actor, now=now)
            self._plans.begin_at(vehicle, 0)
            what = "ready to start"
            active = vehicle.tasks.active
            if active is not None and is_of_autopilot(active) and not vehicle.tasks.paused:
                what += f", task {active.id} goes on until then"
        words = f"Task {task.id} {what}: {describe(task.goal)}{skipped(task.goal)}"
        self._gcs.tell(words, MavSeverity.INFO, vehicle.server_address, now=now)

    def _replace(
        self, desk: UploadSession, vehicle: Vehicle, upload: Upload, *, now: float
    ) -> None:
        """Store an empty mission, or fence or rally points, which the vehicle gets first."""
        if upload.mission_type == MISSION:
            self._store(desk, vehicle, upload, now=now)
            return
        kind, items = upload.mission_type, upload.items
        if kind == MavMissionType.FENCE:
            fence_of(items)  # if it raises, the fence before stays in force
            items = fence_for_vehicle(items)
        store = partial(self._store, desk, vehicle, upload)
        write_through(vehicle, kind, items, store, partial(self._refuse, desk, vehicle), now=now)

    def _store(self, desk: UploadSession, vehicle: Vehicle, upload: Upload, *, now: float) -> None:
        kind, actor = upload.mission_type, str(upload.sender.address)
        before, task = self._plans.stored(vehicle.system_id, kind), self._plans.task(vehicle)
        plan_id = crc32(packed(upload.items).encode()) if upload.items else 0
        self._plans.keep(vehicle, kind, Stored(plan_id, upload.items), actor=actor, now=now)

        def accept(*, now: float) -> None:
            if kind == MISSION:
                self._vehicles.mark_dirty(vehicle)
                self._plans.let_go(vehicle, task, R.CLEARED, actor=actor, now=now)
            desk.receiver.finish(MavMissionResult.ACCEPTED, opaque_id=plan_id, now=now)
            self.flush(desk, vehicle, now=now)

        def undo(*, now: float) -> None:
            self._plans.keep(vehicle, kind, before, actor=actor, now=now)
            refusal = Rejection(R.STORE_UNAVAILABLE, "not stored in time: nothing changed")
            self._refuse(desk, vehicle, refusal, now=now)

        self._submissions.gate.hold(accept, undo, now=now)

    def _refuse(
        self, desk: UploadSession, vehicle: Vehicle, refusal: Rejection, *, now: float
    ) -> None:
        desk.receiver.finish(result_of(refusal), opaque_id=0, now=now)
        self.flush(desk, vehicle, refusal=refusal, now=now)

    def refused(self, sender: Sender, vehicle: Vehicle, refusal: Rejection, *, now: float) -> None:
        """Tell the client why an upload was refused, and record it."""
        self._answers.refused(sender, vehicle, refusal, message_id=0, now=now)

    def _check_replaced(self, client: GcsClient, vehicle: Vehicle, submitter: Submitter) -> None:
        task = self._plans.task(vehicle)
        if task is not None and task.state not in TERMINAL:
            client.rights.require_own(task, submitter, "replace that plan")

    def _client(self, sender: Sender) -> GcsClient:
        client = self._answers.client(sender)
        assert client is not None, "it has just spoken"
        return client
