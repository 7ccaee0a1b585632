"""Takes plans for any rover: uploads to the server's own address, each a task of the rover chosen.

Only the mission type is taken, and nothing is staged or downloaded there. An item is checked when
it comes as far as it is the same for every rover; what depends on the rover is checked when the
plan is whole, of each rover. One upload is under way at a time, as at every address.
"""

from dataclasses import replace
from functools import partial
from math import inf

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.commands.ability import Ability
from mav_tasks.engine.commands.assignments import Assignments, check_any, driven_by
from mav_tasks.engine.commands.submissions import Submissions, chosen_words
from mav_tasks.engine.inputs import NonceTaken
from mav_tasks.engine.missions.item_check import PlanCheck
from mav_tasks.engine.missions.mission_answers import MissionAnswers
from mav_tasks.engine.missions.mission_uploads import draft_of, refusal_of
from mav_tasks.engine.missions.plan_items import result_of, skipped
from mav_tasks.engine.missions.plan_table import MissionParseOptions
from mav_tasks.engine.policy import row_of
from mav_tasks.engine.timers import Timers, Turn
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavMissionResult, MavMissionType, MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.mission_receiver import MissionReceiver, Sender, Upload
from mav_tasks.settings import Settings
from mav_tasks.tasks.deduplicator import reused
from mav_tasks.tasks.goal import GoTo, describe
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import ANY, Task, TaskId

R = TaskReason

#: the messages of an upload
UploadMessage = m.MissionCount | m.MissionItem | m.MissionItemInt | m.MissionAck


class _AnyCheck(PlanCheck):
    """The item check of plans for any rover."""

    def __init__(self, settings: Settings) -> None:
        super().__init__()
        self.settings = settings

    @property
    def _manner(self) -> MissionParseOptions:
        return MissionParseOptions(has_home=False, ability=Ability(), driving=self.settings.driving)

    def _check_place(self, step: GoTo, seq: int) -> None:
        try:
            check_any(step)
        except Rejection as refusal:
            raise Rejection(refusal.reason, f"item {seq + 1}: {refusal.text}") from None


class AnyUploads:
    """The receiver of plans at the server's own address."""

    def __init__(
        self,
        gcs: GcsSide,
        vehicles: VehicleSide,
        registry: TaskRegistry,
        submissions: Submissions,
        assignments: Assignments,
        timers: Timers,
        settings: Settings,
    ) -> None:
        self._gcs = gcs
        self._vehicles = vehicles
        self._registry = registry
        self._submissions = submissions
        self._assignments = assignments
        self._answers = MissionAnswers(gcs, registry)
        self._check = _AnyCheck(settings)
        self._receiver = MissionReceiver(check=self._check, form=m.MissionRequestInt)
        self._timer = timers.timer(Turn.UPLOADS, self._ask_again)

    def __repr__(self) -> str:
        return f"AnyUploads({self._receiver!r})"

    def apply(self, settings: Settings) -> None:
        self._check.settings = settings

    def receive(self, client: GcsClient, packet: Packet, message: m.Message, *, now: float) -> bool:
        """Handle a message of an upload to the server. Return False if it is for somebody else."""
        ours = self._vehicles.our_address
        if not isinstance(message, UploadMessage) or message.target_system != ours.system_id:
            return False
        if message.target_component not in (0, ours.component_id):
            return False
        addressed = Address(ours.system_id, message.target_component or ours.component_id)
        sender = Sender((client.key, client.signed_by.name), packet.source, addressed)
        match message:
            case m.MissionCount():
                self._count(client, sender, packet, message, now=now)
            case m.MissionItem() | m.MissionItemInt():
                self._receiver.item(message, sender, now=now)
            case m.MissionAck():
                self._receiver.cancelled(message, sender, now=now)
        self._flush(now=now)
        return True

    def nonce_taken(self, taken: NonceTaken, *, now: float) -> None:
        """Answer an upload with the task that the fleet had with its nonce."""
        task = self._registry.get(taken.task_id)
        if task is None or task.command != MavCmd.MISSION_START:
            return
        if taken.payload == task.marks.payload:
            self._finish(TaskId(taken.known), now=now)
        else:
            self._refuse(reused(task.marks.nonce), now=now)

    def _count(
        self,
        client: GcsClient,
        sender: Sender,
        packet: Packet,
        message: m.MissionCount,
        *,
        now: float,
    ) -> None:
        kind, row = message.mission_type, row_of(packet.message_id, message)
        try:
            client.rights.require(row.role, f"do this ({row.about})")
            if kind != MavMissionType.MISSION:
                words = f"upload: mission type {kind} belongs to one rover: name it"
                raise Rejection(R.NOT_SUPPORTED_BY_VEHICLE, words)
        except Rejection as refusal:
            self._answers.ack(sender, kind, result_of(refusal), refusal.reason)
            self._tell_refused(sender, refusal, now=now)
            return
        self._receiver.end_gone(self._answers.client, now=now)
        self._receiver.count(message, sender, rank=client.rights.rank, now=now)

    def _ask_again(self, *, now: float) -> None:
        """Request an item again, or end the upload after its time-out."""
        self._receiver.handle_deadline(now=now)
        self._flush(now=now)

    def _flush(self, *, now: float, refusal: Rejection | None = None) -> None:
        """Send messages, and decide about whole uploads; ``refusal``: of the one just decided."""
        outgoing, uploads = self._receiver.take()
        for told in outgoing:
            if isinstance(told.message, m.MissionAck) and told.message.type:
                ended = refusal_of(told.message.type, told.why)
                why = ended if told.why else refusal or self._check.take_refusal() or ended
                told.message.opaque_id = why.reason
                self._answers.send(told)
                self._tell_refused(told.sender, why, now=now)
            else:
                self._answers.send(told)
        for upload in uploads:
            self._decide(upload, now=now)
        due = self._receiver.next_deadline()
        self._timer.set(inf if due is None else due)

    def _take_in(self, upload: Upload, *, now: float) -> None:
        """Submit a whole plan as a task of the rover that is chosen."""
        sender = upload.sender
        client = self._answers.client(sender)
        assert client is not None, "it has just spoken"
        self._submissions.check_open()
        wanted = self._check.plan_of(upload.items, now=now)
        draft = draft_of(ANY, wanted, client, sender)
        client.rights.check_content(draft)
        known = self._submissions.known_plan(draft, begun_at=upload.begun_at, now=now)
        if known is not None:
            self._finish(known, now=now)
            return
        again = partial(self._decide, upload)
        if self._submissions.questions.hold(draft.terms.after, again, self._refuse, now=now):
            return
        choice = self._assignments.choose(wanted.plan, now=now)
        vehicle = self._vehicles.get(choice.vehicle)
        assert vehicle is not None, "it was chosen among them"
        halts = vehicle.tasks.halts
        if upload.begun_at < halts.at:
            raise Rejection(R.STALE, f"{halts.words} came during the upload: upload it again")
        goal = driven_by(vehicle, wanted.plan)
        draft = replace(draft, vehicle=choice.vehicle, goal=goal, choice=choice.words)
        task = self._submissions.submit_plan(client.rights, vehicle, draft, now=now)
        accept = partial(self._accept, vehicle, task)
        self._submissions.gate.hold(accept, partial(self._withdraw, vehicle, task), now=now)

    def _decide(self, upload: Upload, *, now: float) -> None:
        """Submit a whole plan, perhaps held back before, to the best rover now, or refuse it."""
        try:
            self._take_in(upload, now=now)
        except Rejection as why:
            self._refuse(why, now=now)

    def _accept(self, vehicle: Vehicle, task: Task, *, now: float) -> None:
        if self._registry.get(task.id) is None:
            return  # retracted, and answered
        self._vehicles.mark_dirty(vehicle)  # its task may start
        self._finish(task.id, now=now)
        words = (
            f"Task {task.id} queued: {describe(task.goal)}{skipped(task.goal)}{chosen_words(task)}"
        )
        self._gcs.tell(words, MavSeverity.INFO, vehicle.server_address, now=now)

    def _withdraw(self, vehicle: Vehicle, task: Task, *, now: float) -> None:
        if self._registry.get(task.id) is None:
            return
        self._vehicles.mark_dirty(vehicle)
        self._submissions.take_back(vehicle, task, now=now)
        self._refuse(Rejection(R.STORE_UNAVAILABLE, "not stored in time: not accepted"), now=now)

    def _finish(self, task_id: TaskId, *, now: float) -> None:
        self._receiver.finish(MavMissionResult.ACCEPTED, opaque_id=task_id, now=now)
        self._flush(now=now)

    def _refuse(self, refusal: Rejection, *, now: float) -> None:
        self._receiver.finish(result_of(refusal), opaque_id=0, now=now)
        self._flush(refusal=refusal, now=now)

    def _tell_refused(self, sender: Sender, refusal: Rejection, *, now: float) -> None:
        """Tell the client why an upload was refused, and record it."""
        at = self._vehicles.our_address
        self._answers.refused_at(sender, at, ANY, refusal, message_id=0, now=now)
