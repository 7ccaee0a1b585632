"""Dispatches clients' mission protocol messages by address and plan type, and serves downloads.

``mission_uploads`` handles whole uploads, ``mission_clearing`` MISSION_CLEAR_ALL.
"""

from collections.abc import Collection
from functools import partial
from typing import NamedTuple

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.commands.assignments import Assignments
from mav_tasks.engine.commands.submissions import Submissions
from mav_tasks.engine.inputs import NonceTaken
from mav_tasks.engine.missions.go_to_items import GoToItems
from mav_tasks.engine.missions.item_check import AnyCheck, ItemCheck, PlanCheck
from mav_tasks.engine.missions.mission_answers import MissionAnswers
from mav_tasks.engine.missions.mission_clearing import MissionClearing
from mav_tasks.engine.missions.mission_uploads import MissionUploads, UploadSession
from mav_tasks.engine.missions.plan_items import result_of
from mav_tasks.engine.missions.plans import MISSION, STORED, Plans, Stored
from mav_tasks.engine.policy import GO_TO, row_of
from mav_tasks.engine.timers import Timers
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavCmd, MavMissionResult, MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.mission_item import unpacked
from mav_tasks.services.mission_receiver import RequestForm, Sender
from mav_tasks.services.mission_sender import MissionSender
from mav_tasks.settings import Settings
from mav_tasks.tasks.deduplicator import reused
from mav_tasks.tasks.goal import Plan
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.registry import TaskRegistry

#: messages of the mission protocol from clients
MissionMessage = (
    m.MissionCount
    | m.MissionItem
    | m.MissionItemInt
    | m.MissionRequestList
    | m.MissionRequest
    | m.MissionRequestInt
    | m.MissionAck
    | m.MissionClearAll
    | m.MissionSetCurrent
    | m.MissionRequestPartialList
    | m.MissionWritePartialList
)


#: the messages of an upload
UploadMessage = m.MissionCount | m.MissionItem | m.MissionItemInt | m.MissionAck

GIVES_UP = 3.0  # s without MISSION_CURRENT, after which MAVSDK has taken a refusal in


class _Desk(NamedTuple):
    """The uploads to and downloads from one address, of one plan type."""

    uploads: UploadSession
    sender: MissionSender


class MissionServers:
    """The servers of the mission protocol at all addresses."""

    def __init__(
        self,
        gcs: GcsSide,
        vehicles: VehicleSide,
        registry: TaskRegistry,
        submissions: Submissions,
        assignments: Assignments,
        plans: Plans,
        timers: Timers,
        settings: Settings,
    ) -> None:
        self._vehicles = vehicles
        self._registry = registry
        self._plans = plans
        self._timers = timers
        self._answers = MissionAnswers(gcs, vehicles, registry)
        self._uploads = MissionUploads(
            gcs, vehicles, registry, submissions, assignments, plans, self._answers
        )
        self._clearing = MissionClearing(vehicles, submissions, plans, self._answers)
        self._go_to = GoToItems(submissions, registry)
        self._desks: dict[tuple[int, int, int], _Desk] = {}
        #: of plans at the server's own address, for any vehicle
        self._check_any = AnyCheck(settings)
        self._any = self._session(None, self._check_any, m.MissionRequestInt)

    def apply(self, settings: Settings) -> None:
        self._check_any.settings = settings

    def nonce_taken(self, taken: NonceTaken, *, now: float) -> None:
        """Answer an upload with the task that the fleet had with its nonce."""
        task = self._registry.get(taken.task_id)
        if task is None or task.command != MavCmd.MISSION_START:
            return
        if taken.payload == task.marks.payload:
            self._any.accept(taken.known, now=now)
        else:
            self._any.refuse(reused(task.marks.nonce), now=now)

    def receive(
        self, client: GcsClient, packet: Packet, message: MissionMessage, *, now: float
    ) -> bool:
        """Handle a client's message. Return False if it is not for the server."""
        # most messages leave the vehicle as it is; the others mark it dirty
        vehicle = self._vehicles.look_at(message.target_system)
        if vehicle is None:
            return self._receive_for_any(client, packet, message, now=now)
        component = message.target_component or AUTOPILOT
        at_server = component == vehicle.server_component
        if not at_server and (component != AUTOPILOT or not vehicle.parts.settings.claim):
            return False
        desk = self._desk(vehicle, component, getattr(message, "mission_type", MISSION))
        sender = _sender(client, packet, Address(vehicle.system_id, component))
        if self._is_refused(client, sender, packet, message, STORED, now=now):
            return True
        match message:
            case m.MissionItem() | m.MissionItemInt() if message.current in GO_TO:
                self._vehicles.mark_dirty(vehicle)  # never a plan item, even during an upload
                self._go_to.receive(client, vehicle, packet, message, now=now)
            case m.MissionCount() | m.MissionItem() | m.MissionItemInt() | m.MissionAck():
                self._receive_upload(desk.uploads, client, sender, message, now=now)
                if isinstance(message, m.MissionAck):
                    desk.sender.end(sender, message.mission_type)
            case m.MissionRequestList():
                self._list(desk, vehicle, sender, message.mission_type, now=now)
            case m.MissionRequest() | m.MissionRequestInt():
                kind, seq = message.mission_type, message.seq
                self._answers.send(
                    desk.sender.request(
                        sender,
                        kind,
                        seq,
                        lambda: self._downloadable(vehicle, component, kind).items,
                        form=type(message),
                        now=now,
                    )
                )
            case m.MissionClearAll():
                self._vehicles.mark_dirty(vehicle)
                is_late = client.is_late
                kind = message.mission_type
                self._clearing.clear(vehicle, sender, kind, is_late=is_late, now=now)
            case m.MissionSetCurrent():
                self._vehicles.mark_dirty(vehicle)
                self._set_current(vehicle, client, sender, message.seq, now=now)
            case m.MissionRequestPartialList() | m.MissionWritePartialList():
                self._answers.ack(sender, message.mission_type, MavMissionResult.UNSUPPORTED)
        return True

    def _receive_for_any(
        self, client: GcsClient, packet: Packet, message: MissionMessage, *, now: float
    ) -> bool:
        """Handle an upload to the server's own address; return whether the message is one."""
        ours = self._vehicles.our_address
        addressed = message.target_system, message.target_component or ours.component_id
        if addressed != ours or not isinstance(message, UploadMessage):
            return False
        sender = _sender(client, packet, ours)
        if not self._is_refused(client, sender, packet, message, (MISSION,), now=now):
            self._receive_upload(self._any, client, sender, message, now=now)
        return True

    def _receive_upload(
        self,
        session: UploadSession,
        client: GcsClient,
        sender: Sender,
        message: UploadMessage,
        *,
        now: float,
    ) -> None:
        receiver = session.receiver
        match message:
            case m.MissionCount():
                receiver.end_gone(self._answers.client, now=now)
                receiver.count(message, sender, rank=client.rights.rank, now=now)
            case m.MissionAck():
                receiver.cancelled(message, sender, now=now)
            case _:
                receiver.item(message, sender, now=now)
        session.flush(now=now)

    def forget(self, vehicle: int) -> None:
        """End the transfers of a vehicle's plans: clients begin again at its next gateway."""
        for key in [each for each in self._desks if each[0] == vehicle]:
            self._timers.forget(self._desks.pop(key).uploads.timer)

    def _is_refused(
        self,
        client: GcsClient,
        sender: Sender,
        packet: Packet,
        message: MissionMessage,
        kinds: Collection[int],
        *,
        now: float,
    ) -> bool:
        """Whether a message is refused because of the client's role, or an upload by its kind.

        If so, answer it.
        """
        if isinstance(message, m.MissionSetCurrent) or getattr(message, "current", 0) in GO_TO:
            return False  # these are checked and answered elsewhere
        kind = getattr(message, "mission_type", MISSION)
        row = row_of(packet.message_id, message)
        try:
            client.rights.require(row.role, f"do this ({row.about})")
            if isinstance(message, m.MissionCount) and kind not in kinds:
                why = "belongs to one rover: name it" if kind in STORED else "is not supported"
                words = f"upload: mission type {kind} {why}"
                raise Rejection(TaskReason.NOT_SUPPORTED_BY_VEHICLE, words)
        except Rejection as refusal:
            if isinstance(message, m.MissionCount | m.MissionClearAll):
                self._answers.ack(sender, kind, result_of(refusal), refusal.reason)
                message_id = 0 if isinstance(message, m.MissionCount) else type(message).id
                self._answers.refused(sender, refusal, message_id=message_id, now=now)
            return True
        return False

    def _session(
        self, vehicle: Vehicle | None, check: PlanCheck, form: RequestForm
    ) -> UploadSession:
        decide = partial(self._uploads.decide, vehicle)
        return UploadSession(check, form, self._answers, self._timers, decide)

    def _desk(self, vehicle: Vehicle, component: int, kind: int) -> _Desk:
        key = vehicle.system_id, component, kind if kind in STORED else MISSION
        desk = self._desks.get(key)
        if desk is None:
            is_plain = component == AUTOPILOT and not vehicle.persona.has_int_requests
            form = m.MissionRequest if is_plain else m.MissionRequestInt
            session = self._session(vehicle, ItemCheck(vehicle, component), form)
            desk = self._desks[key] = _Desk(session, MissionSender())
        return desk

    def _downloadable(self, vehicle: Vehicle, component: int, kind: int) -> Stored:
        """Return the plan to download; the task server's mission is the active one, if any."""
        active = vehicle.tasks.active
        if kind == MISSION and component != AUTOPILOT and active and isinstance(active.goal, Plan):
            return Stored(active.id, unpacked(active.goal.source))
        return self._plans.stored(vehicle.system_id, kind)

    def _list(
        self, desk: _Desk, vehicle: Vehicle, sender: Sender, kind: int, *, now: float
    ) -> None:
        if kind not in STORED:
            self._answers.ack(sender, kind, MavMissionResult.UNSUPPORTED)
            return
        stored = self._downloadable(vehicle, sender.addressed.component_id, kind)
        count = desk.sender.begin(sender, kind, stored.items, opaque_id=stored.plan_id, now=now)
        self._answers.send(count)

    def _set_current(
        self, vehicle: Vehicle, client: GcsClient, sender: Sender, seq: int, *, now: float
    ) -> None:
        """Handle MISSION_SET_CURRENT. An ArduPilot (4.6.3) does not answer one that it refuses.

        MAVSDK asks again at each MISSION_CURRENT with another number, for ever; after 2.5 s without
        any it gives up, so its client gets none for a while.
        """
        try:
            self._plans.check_start(client.rights, vehicle, client.submitter(sender.address))
            if self._plans.go_on_with(vehicle, seq, now=now) is None:
                words = self._plans.begins_with(vehicle, seq)
                client.tell(words, MavSeverity.INFO, vehicle.server_address, now=now)
        except Rejection as refusal:
            message_id = m.MissionSetCurrent.id
            self._answers.refused(sender, refusal, message_id=message_id, now=now)
            client.gives_up_at = now + GIVES_UP
            return
        client.outlet.send(
            self._plans.current(vehicle, seq=seq), Address(vehicle.system_id, AUTOPILOT)
        )


def _sender(client: GcsClient, packet: Packet, addressed: Address) -> Sender:
    return Sender((client.key, client.signed_by.name), packet.source, addressed)  # of several keys
