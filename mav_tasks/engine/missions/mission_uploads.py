"""Decides about whole uploads: refuses, submits or stores them; acknowledges them when durable.

The autopilot's address has one mission, which is staged until it is started, as on an autopilot.
The task server's address takes any number; each is queued at once. Fence and rally points belong to
the vehicle, at either address. A plan at the server's own address becomes a task of the vehicle
that it chooses.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from hashlib import blake2b
from math import inf
from zlib import crc32

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.commands.assignments import Assignments, driven_by
from mav_tasks.engine.commands.submissions import Submissions, chosen_words
from mav_tasks.engine.missions.fence_items import fence_for_vehicle, fence_of
from mav_tasks.engine.missions.item_check import PlanCheck
from mav_tasks.engine.missions.mission_answers import MissionAnswers
from mav_tasks.engine.missions.plan_items import result_of, skipped
from mav_tasks.engine.missions.plans import MISSION, Plans, Stored, is_of_autopilot
from mav_tasks.engine.missions.write_through import write_through
from mav_tasks.engine.timers import Timers, Turn
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
from mav_tasks.tasks.task import ANY, Draft, Marks, Submitter, Task

R = TaskReason

#: reason of an upload that the receiver itself ended, by its MAV_MISSION_RESULT
ENDED = {
    MavMissionResult.DENIED: R.WRONG_STATE,  # another client uploads
    MavMissionResult.NO_SPACE: R.QUEUE_FULL,
    MavMissionResult.OPERATION_CANCELLED: R.WRONG_STATE,
}


class UploadSession:
    """The receiver of uploads to one address, and the answers to them."""

    def __init__(
        self,
        check: PlanCheck,
        form: RequestForm,
        answers: MissionAnswers,
        timers: Timers,
        decide: Callable[..., None],
    ) -> None:
        """``decide`` submits or stores a whole upload, or raises Rejection."""
        self.check = check
        self.receiver = MissionReceiver(check=check, form=form)
        self._answers = answers
        self._decide = decide
        #: requests an item again, or ends the upload after its time-out
        self.timer = timers.timer(Turn.UPLOADS, self._ask_again)

    def flush(self, *, now: float, refusal: Rejection | None = None) -> None:
        """Send messages, and decide about whole uploads; ``refusal``: of the one just decided."""
        outgoing, uploads = self.receiver.take()
        for told in outgoing:
            ack = told.message
            if not isinstance(ack, m.MissionAck) or not ack.type:
                self._answers.send(told)
                continue
            why = None if told.why else refusal or self.check.take_refusal()
            if why is None:
                reason = ENDED.get(MavMissionResult(ack.type), R.BAD_PARAMETER)
                why = Rejection(reason, f"upload: {told.why or 'an item cannot be read'}")
            ack.opaque_id = why.reason
            self._answers.send(told)
            self._answers.refused(told.sender, why, now=now)
        for upload in uploads:
            self.decide(upload, now=now)
        due = self.receiver.next_deadline()
        self.timer.set(inf if due is None else due)

    def decide(self, upload: Upload, *, now: float) -> None:
        """Decide about a whole upload, perhaps held back before."""
        try:
            self._decide(self, upload, now=now)
        except Rejection as refusal:
            self.refuse(refusal, now=now)

    def accept(self, plan_id: int, *, now: float) -> None:
        self.receiver.finish(MavMissionResult.ACCEPTED, opaque_id=plan_id, now=now)
        self.flush(now=now)

    def refuse(self, refusal: Rejection, *, now: float) -> None:
        self.receiver.finish(result_of(refusal), opaque_id=0, now=now)
        self.flush(refusal=refusal, now=now)

    def _ask_again(self, *, now: float) -> None:
        self.receiver.handle_deadline(now=now)
        self.flush(now=now)


@dataclass(repr=False, eq=False)
class MissionUploads:
    """The decision about whole uploads."""

    _gcs: GcsSide
    _vehicles: VehicleSide
    _registry: TaskRegistry
    _submissions: Submissions
    _assignments: Assignments
    _plans: Plans
    _answers: MissionAnswers

    def decide(
        self, vehicle: Vehicle | None, session: UploadSession, upload: Upload, *, now: float
    ) -> None:
        """Submit or store a whole upload; None: for any vehicle. Raise Rejection if refused."""
        self._submissions.check_open()
        client = self._answers.client(upload.sender)
        if client is None:
            raise Rejection(R.WRONG_STATE, "the client has gone")
        is_staged = upload.sender.addressed.component_id == AUTOPILOT
        if vehicle is not None:
            self._vehicles.mark_dirty(vehicle)
            is_mission = upload.mission_type == MISSION
            if is_mission and len(upload.items) <= (vehicle.persona.has_home_item and is_staged):
                self._check_not_begun(vehicle, client, upload.sender)
                upload = upload._replace(items=())
            if not is_mission or not upload.items:
                self._replace(session, vehicle, upload, now=now)
                return
        self._take_in(session, vehicle, client, upload, is_staged=is_staged, now=now)

    def _check_not_begun(self, vehicle: Vehicle, client: GcsClient, sender: Sender) -> None:
        """Raise Rejection unless a client may remove the mission, which must not have started."""
        task = self._plans.task(vehicle)
        if task is not None and task.state in ACTIVE:
            raise Rejection(R.NOT_ALLOWED, f"task {task.id} has started: cancel it first")
        self._check_replaced(client, vehicle, client.submitter(sender.address))

    def _take_in(
        self,
        session: UploadSession,
        vehicle: Vehicle | None,
        client: GcsClient,
        upload: Upload,
        *,
        is_staged: bool,
        now: float,
    ) -> None:
        """Submit a mission as a task, staged or queued."""
        sender = upload.sender
        wanted = session.check.plan_of(upload.items, now=now)
        terms = replace(wanted.terms, is_staged=is_staged, is_cruising=is_staged)
        what = f"{sender.addressed} {wanted.plan.source}".encode()
        nonce = 0 if is_staged else wanted.nonce  # two of one content differ by their nonces
        draft = Draft(
            ANY if vehicle is None else vehicle.system_id,
            MavCmd.MISSION_START,
            wanted.plan,
            client.submitter(sender.address),
            terms,
            Marks(nonce, blake2b(what, digest_size=9).hexdigest()),
        )
        client.rights.check_content(draft)
        # ``begun_at``: a long plan may come again later than submissions are remembered
        known = None
        if not is_staged:
            known = self._submissions.known_plan(draft, begun_at=upload.begun_at, now=now)
        if known is not None:
            session.accept(known, now=now)
            words, by = f"repeated plan, no new task: see task {known}", sender.addressed
            client.tell(words, MavSeverity.WARNING, by, now=now)
            return
        again, after = partial(session.decide, upload), draft.terms.after
        if self._submissions.questions.hold(after, again, session.refuse, now=now):
            return
        if vehicle is None:
            choice = self._assignments.choose(wanted.plan, now=now)
            vehicle = self._vehicles.get(choice.vehicle)
            assert vehicle is not None, "it was chosen among them"
            goal = driven_by(vehicle, wanted.plan)
            draft = replace(draft, vehicle=choice.vehicle, goal=goal, choice=choice.words)
        halts = vehicle.tasks.halts
        if not is_staged and upload.begun_at < halts.at:
            raise Rejection(R.STALE, f"{halts.words} came during the upload: upload it again")
        before, actor = self._plans.stored(vehicle.system_id, MISSION), str(sender.address)
        if is_staged:
            self._check_replaced(client, vehicle, draft.submitter)
        task = self._submissions.submit_plan(client.rights, vehicle, draft, now=now)
        if is_staged:
            stored = Stored(task.id, upload.items)
            self._plans.keep(vehicle, MISSION, stored, actor=actor, now=now)
        accept = partial(self._accept, session, vehicle, task, actor=actor)

        def withdraw(*, now: float) -> None:
            if self._registry.get(task.id) is None:
                return  # retracted, and answered
            self._vehicles.mark_dirty(vehicle)
            self._submissions.take_back(vehicle, task, now=now)
            if is_staged:
                self._plans.keep(vehicle, MISSION, before, actor=actor, now=now)
            refusal = Rejection(R.STORE_UNAVAILABLE, "not stored in time: not accepted")
            session.refuse(refusal, now=now)

        self._submissions.gate.hold(accept, withdraw, now=now)

    def _accept(
        self, session: UploadSession, vehicle: Vehicle, task: Task, *, actor: str, now: float
    ) -> None:
        if self._registry.get(task.id) is None:
            return  # retracted, and answered
        self._vehicles.mark_dirty(vehicle)  # a task may start
        session.accept(task.id, now=now)
        what = "queued"
        if task.terms.is_staged:
            self._plans.end_replaced(vehicle, is_started=False, actor=actor, now=now)
            self._plans.begin_at(vehicle, 0)
            what = "ready to start"
            active = vehicle.tasks.active
            if active is not None and is_of_autopilot(active) and not vehicle.tasks.paused:
                what += f", task {active.id} goes on until then"
        words = f"Task {task.id} {what}: {describe(task.goal)}{skipped(task.goal)}"
        words += chosen_words(task)
        self._gcs.tell(words, MavSeverity.INFO, vehicle.server_address, now=now)

    def _replace(
        self, session: UploadSession, vehicle: Vehicle, upload: Upload, *, now: float
    ) -> None:
        """Store an empty mission, or fence or rally points, which the vehicle gets first."""
        kind, items, actor = upload.mission_type, upload.items, str(upload.sender.address)

        def store(*, now: float) -> None:
            before, task = self._plans.stored(vehicle.system_id, kind), self._plans.task(vehicle)
            plan_id = crc32(packed(upload.items).encode()) if upload.items else 0
            self._plans.keep(vehicle, kind, Stored(plan_id, upload.items), actor=actor, now=now)

            def accept(*, now: float) -> None:
                if kind == MISSION:
                    self._vehicles.mark_dirty(vehicle)
                    self._plans.let_go(vehicle, task, R.CLEARED, actor=actor, now=now)
                session.accept(plan_id, now=now)

            def undo(*, now: float) -> None:
                self._plans.keep(vehicle, kind, before, actor=actor, now=now)
                refusal = Rejection(R.STORE_UNAVAILABLE, "not stored in time: nothing changed")
                session.refuse(refusal, now=now)

            self._submissions.gate.hold(accept, undo, now=now)

        if kind == MISSION:
            store(now=now)
            return
        if kind == MavMissionType.FENCE:
            fence_of(items)  # if it raises, the fence before stays in force
            items = fence_for_vehicle(items)
        write_through(vehicle, kind, items, store, session.refuse, now=now)

    def _check_replaced(self, client: GcsClient, vehicle: Vehicle, submitter: Submitter) -> None:
        task = self._plans.task(vehicle)
        if task is not None and task.state not in TERMINAL:
            client.rights.require_own(task, submitter, "replace that plan")
