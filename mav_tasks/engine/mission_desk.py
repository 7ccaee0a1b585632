"""The mission protocol towards clients: uploads, downloads, clearing; and what becomes of uploads.

To the autopilot's address goes one mission, which waits until it is started, as on an autopilot; to
the task server's go as many as one likes, each queued at once. Fence and rally points are the
vehicle's, whichever address they were sent to.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from hashlib import blake2b
from typing import Protocol
from zlib import crc32

from mav_tasks.engine.commit_gate import Effect
from mav_tasks.engine.fence_items import fence_of
from mav_tasks.engine.gcs_client import GcsClient
from mav_tasks.engine.gcs_side import GcsSide
from mav_tasks.engine.item_check import ItemCheck
from mav_tasks.engine.motion_gate import GO_TO
from mav_tasks.engine.plan_items import result_of
from mav_tasks.engine.plans import (
    MISSION,
    NOTHING,
    STORED,
    Plans,
    Stored,
    plan_of_task,
)
from mav_tasks.engine.submissions import Submissions
from mav_tasks.engine.vehicle import Vehicle
from mav_tasks.engine.vehicle_side import VehicleSide
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavCmd, MavMissionResult, MavMissionType, MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.mission_item import Item, packed, unpacked
from mav_tasks.services.mission_receiver import MissionReceiver, Sender, ToClient, Upload
from mav_tasks.services.mission_sender import MissionSender
from mav_tasks.settings import Settings
from mav_tasks.tasks.book import TaskBook
from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.goal import Plan
from mav_tasks.tasks.lifecycle import ACTIVE, TaskReason
from mav_tasks.tasks.task import Draft, Marks, Task, TaskId, Terms

R = TaskReason

#: what clients speak the mission protocol with
MESSAGES = (
    m.MissionCount,
    m.MissionItem,
    m.MissionItemInt,
    m.MissionRequestList,
    m.MissionRequest,
    m.MissionRequestInt,
    m.MissionAck,
    m.MissionClearAll,
    m.MissionSetCurrent,
    m.MissionRequestPartialList,
    m.MissionWritePartialList,
)
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


class Refuse(Protocol):
    """What is done when something is refused."""

    def __call__(self, refusal: Rejection, *, now: float) -> None: ...


class _Desk:
    """Uploads to, and downloads from, one address."""

    def __init__(self, check: ItemCheck) -> None:
        self.check = check
        self.receiver = MissionReceiver(check=check)
        self.sender = MissionSender()


class MissionDesks:
    """The ends of uploads and downloads at all addresses."""

    def __init__(
        self,
        gcs: GcsSide,
        vehicles: VehicleSide,
        book: TaskBook,
        submissions: Submissions,
        plans: Plans,
        settings: Settings,
    ) -> None:
        self._gcs = gcs
        self._vehicles = vehicles
        self._book = book
        self._submissions = submissions
        self._plans = plans
        self._settings = settings
        self._desks: dict[tuple[int, int], _Desk] = {}

    def apply(self, settings: Settings) -> None:
        """Take new settings."""
        self._settings = settings
        for desk in self._desks.values():
            desk.check.apply(settings)

    # the mission protocol

    def receive(
        self, client: GcsClient, packet: Packet, message: MissionMessage, *, now: float
    ) -> bool:
        """See to a client's message; False: it is not for us."""
        vehicle = self._vehicles.get(message.target_system)
        if vehicle is None:
            return False
        component = message.target_component or AUTOPILOT
        at_server = component == vehicle.server_component
        if not at_server and (component != AUTOPILOT or not self._settings.claim):
            return False
        desk = self._desk(vehicle, component)
        sender = Sender(client.key, packet.source, Address(vehicle.system_id, component))
        match message:
            case m.MissionCount() if message.mission_type not in STORED:
                self._ack(sender, message.mission_type, MavMissionResult.UNSUPPORTED)
            case m.MissionCount():
                desk.receiver.count(message, sender, now=now)
            case m.MissionItem() | m.MissionItemInt():
                if not desk.receiver.item(message, sender, now=now):
                    return message.current not in GO_TO
            case m.MissionAck():
                desk.receiver.cancelled(message, sender, now=now)
                desk.sender.end(sender, message.mission_type)
            case m.MissionRequestList():
                self._list(desk, vehicle, sender, message.mission_type, now=now)
            case m.MissionRequest() | m.MissionRequestInt():
                kind, seq = message.mission_type, message.seq
                self._send(
                    desk.sender.request(
                        sender,
                        kind,
                        seq,
                        lambda: self._downloadable(vehicle, component, kind).items,
                        now=now,
                    )
                )
            case m.MissionClearAll():
                self._clear(vehicle, sender, message.mission_type, now=now)
            case m.MissionSetCurrent():
                self._set_current(vehicle, client, sender, message.seq, now=now)
            case m.MissionRequestPartialList() | m.MissionWritePartialList():
                self._ack(sender, message.mission_type, MavMissionResult.UNSUPPORTED)
        self._flush(desk, vehicle, now=now)
        return True

    def next_deadline(self) -> float | None:
        """Give when an item is to be asked for again, or an upload given up."""
        deadlines = [desk.receiver.next_deadline() for desk in self._desks.values()]
        return min((d for d in deadlines if d is not None), default=None)

    def handle_deadline(self, *, now: float) -> None:
        """Ask again, and give up."""
        for (system_id, _), desk in self._desks.items():
            due = desk.receiver.next_deadline()
            vehicle = self._vehicles.get(system_id) if due is not None and due <= now else None
            if vehicle is not None:
                desk.receiver.handle_deadline(now=now)
                self._flush(desk, vehicle, now=now)

    def _desk(self, vehicle: Vehicle, component: int) -> _Desk:
        key = vehicle.system_id, component
        desk = self._desks.get(key)
        if desk is None:
            desk = self._desks[key] = _Desk(ItemCheck(vehicle, component, self._settings))
        return desk

    def _flush(self, desk: _Desk, vehicle: Vehicle, *, now: float) -> None:
        outgoing, uploads = desk.receiver.take()
        for told in outgoing:
            self._send(told)
            why = desk.check.take_why() if isinstance(told.message, m.MissionAck) else ""
            if why:
                self._tell(told.sender, vehicle, why, now=now)
        for upload in uploads:
            self._decide(desk, vehicle, upload, now=now)

    def _client(self, sender: Sender) -> GcsClient | None:
        assert isinstance(sender.key, tuple), "only receive() makes senders"
        return self._gcs.client(sender.key)

    def _send(self, told: ToClient) -> None:
        client = self._client(told.sender)
        if client is not None:
            client.outlet.send(told.message, told.sender.addressed)

    def _ack(self, sender: Sender, kind: int, result: MavMissionResult) -> None:
        self._send(ToClient(sender, m.MissionAck(*sender.address, result, kind)))

    def _tell(self, sender: Sender, vehicle: Vehicle, words: str, *, now: float) -> None:
        client = self._client(sender)
        if client is not None:
            client.tell(words, MavSeverity.WARNING, vehicle.server_address, now=now)

    def _downloadable(self, vehicle: Vehicle, component: int, kind: int) -> Stored:
        """What an address has to show: the task server, of missions, the one that is driven."""
        begun = vehicle.tasks.begun
        if kind == MISSION and component != AUTOPILOT and begun and isinstance(begun.goal, Plan):
            return Stored(begun.id, unpacked(begun.goal.source))
        return self._plans.stored(vehicle.system_id, kind)

    def _list(
        self, desk: _Desk, vehicle: Vehicle, sender: Sender, kind: int, *, now: float
    ) -> None:
        if kind not in STORED:
            self._ack(sender, kind, MavMissionResult.UNSUPPORTED)
            return
        stored = self._downloadable(vehicle, sender.addressed.component_id, kind)
        count = desk.sender.begin(sender, kind, stored.items, opaque_id=stored.plan_id, now=now)
        self._send(count)

    # what becomes of an upload

    def _decide(self, desk: _Desk, vehicle: Vehicle, upload: Upload, *, now: float) -> None:
        try:
            self._submissions.check_open()
            if upload.mission_type != MISSION:
                self._replace(desk, vehicle, upload, now=now)
            elif self._is_nothing(vehicle, upload):
                self._check_not_begun(vehicle)
                self._replace(desk, vehicle, upload._replace(items=()), now=now)
            else:
                self._take_in(desk, vehicle, upload, now=now)
        except Rejection as refusal:
            self._refuse(desk, vehicle, upload.sender, refusal, now=now)

    def _check_not_begun(self, vehicle: Vehicle) -> None:
        task = self._plans.task(vehicle)
        if task is not None and task.state in ACTIVE:
            raise Rejection(R.NOT_ALLOWED, f"task {task.id} has begun: cancel it first")

    def _is_nothing(self, vehicle: Vehicle, upload: Upload) -> bool:
        """Whether a mission is none: not an item, or only the home that comes before all others."""
        is_staged = upload.sender.addressed.component_id == AUTOPILOT
        return len(upload.items) <= (vehicle.persona.has_home_item and is_staged)

    def _take_in(self, desk: _Desk, vehicle: Vehicle, upload: Upload, *, now: float) -> None:
        """A mission: a task that waits to be started, or is queued."""
        sender = upload.sender
        is_staged = sender.addressed.component_id == AUTOPILOT
        wanted = desk.check.plan_of(upload.items, now=now)
        terms = replace(wanted.terms, is_staged=is_staged)
        draft = self._draft(vehicle, wanted.plan, terms, sender)
        # a long plan may take longer to come again than it is remembered
        known = None
        if not is_staged:
            known = self._submissions.known_plan(draft, begun_at=upload.begun_at)
        if known is not None:
            desk.receiver.finish(MavMissionResult.ACCEPTED, opaque_id=known, now=now)
            self._flush(desk, vehicle, now=now)
            words = f"same plan again: still task {known}"
            self._tell(sender, vehicle, words, now=now)
            return
        before = self._plans.stored(vehicle.system_id, MISSION)
        task = self._submissions.submit_plan(vehicle, draft, now=now)
        if is_staged:
            self._plans.keep(
                vehicle, MISSION, Stored(task.id, upload.items), actor=str(sender.address), now=now
            )
        self._submissions.when_durable(
            partial(self._accept, desk, vehicle, sender, task, before),
            partial(self._withdraw, desk, vehicle, sender, task, before),
            now=now,
        )

    def _accept(
        self,
        desk: _Desk,
        vehicle: Vehicle,
        sender: Sender,
        task: Task,
        before: Stored,
        *,
        now: float,
    ) -> None:
        self._vehicles.get(vehicle.system_id)  # something may begin there
        desk.receiver.finish(MavMissionResult.ACCEPTED, opaque_id=task.id, now=now)
        self._flush(desk, vehicle, now=now)
        replaced = self._book.get(TaskId(before.plan_id))
        if task.terms.is_staged and replaced is not None:
            self._plans.end(vehicle, replaced, R.REPLACED, actor=str(sender.address), now=now)
        if task.terms.is_staged:
            self._plans.begin_at(vehicle, 0)
        what = "ready to be started" if task.terms.is_staged else "queued"
        words = f"Task {task.id} {what}: plan of {len(plan_of_task(task).steps)} items"
        self._gcs.tell(words, MavSeverity.INFO, vehicle.server_address, now=now)

    def _withdraw(
        self,
        desk: _Desk,
        vehicle: Vehicle,
        sender: Sender,
        task: Task,
        before: Stored,
        *,
        now: float,
    ) -> None:
        self._vehicles.get(vehicle.system_id)
        self._submissions.take_back(vehicle, task, now=now)
        if task.terms.is_staged:
            self._plans.keep(vehicle, MISSION, before, actor=str(sender.address), now=now)
        refusal = Rejection(R.STORE_UNAVAILABLE, "not stored in time: not accepted")
        self._refuse(desk, vehicle, sender, refusal, now=now)

    def _replace(self, desk: _Desk, vehicle: Vehicle, upload: Upload, *, now: float) -> None:
        """Fence and rally points, which the vehicle keeps as well, and the empty mission."""
        if upload.mission_type == MISSION:
            self._store(desk, vehicle, upload, now=now)
            return
        if upload.mission_type == MavMissionType.FENCE:
            fence_of(upload.items)  # a Rejection leaves the one before in force
        store = partial(self._store, desk, vehicle, upload)
        refuse = partial(self._refuse, desk, vehicle, upload.sender)
        kind, items = upload.mission_type, upload.items
        self._write_through(vehicle, kind, items, store, refuse, now=now)

    def _write_through(
        self,
        vehicle: Vehicle,
        kind: int,
        items: tuple[Item, ...],
        go_on: Effect,
        refuse: Refuse,
        *,
        now: float,
    ) -> None:
        """First the vehicle, which keeps it where we cannot watch; one that has no such thing may.

        What it refuses, or does not answer, changes nothing here.
        """

        def done(result: MavMissionResult | None, *, now: float) -> None:
            self._vehicles.get(vehicle.system_id)
            if result in (MavMissionResult.ACCEPTED, MavMissionResult.UNSUPPORTED):
                go_on(now=now)
            elif result is None:
                words = f"vehicle {vehicle.system_id} does not answer: not stored"
                refuse(Rejection(R.VEHICLE_SILENT, words), now=now)
            else:
                words = f"vehicle {vehicle.system_id} refuses it: {result.name}"
                refuse(Rejection(R.NOT_ALLOWED, words), now=now)

        vehicle.requests.write_plan(kind, items, done, now=now)

    def _store(self, desk: _Desk, vehicle: Vehicle, upload: Upload, *, now: float) -> None:
        sender, kind = upload.sender, upload.mission_type
        before, task = self._plans.stored(vehicle.system_id, kind), self._plans.task(vehicle)
        plan_id = crc32(packed(upload.items).encode()) if upload.items else 0
        actor, stored = str(sender.address), Stored(plan_id, upload.items)
        self._plans.keep(vehicle, kind, stored, actor=actor, now=now)

        def accept(*, now: float) -> None:
            if kind == MISSION:
                self._end(vehicle, task, R.CLEARED, actor, now=now)
            desk.receiver.finish(MavMissionResult.ACCEPTED, opaque_id=plan_id, now=now)
            self._flush(desk, vehicle, now=now)

        def give_up(*, now: float) -> None:
            self._plans.keep(vehicle, kind, before, actor=actor, now=now)
            refusal = Rejection(R.STORE_UNAVAILABLE, "not stored in time: as it was before")
            self._refuse(desk, vehicle, sender, refusal, now=now)

        self._submissions.when_durable(accept, give_up, now=now)

    def _end(
        self, vehicle: Vehicle, task: Task | None, reason: TaskReason, actor: str, *, now: float
    ) -> None:
        """A mission is not the vehicle's any more: if it has not begun, it never will."""
        self._vehicles.get(vehicle.system_id)
        current = None if task is None else self._book.get(task.id)
        if current is not None:
            self._plans.end(vehicle, current, reason, actor=actor, now=now)
        self._plans.begin_at(vehicle, 0)

    def _refuse(
        self, desk: _Desk, vehicle: Vehicle, sender: Sender, refusal: Rejection, *, now: float
    ) -> None:
        desk.receiver.finish(result_of(refusal), opaque_id=0, now=now)
        self._flush(desk, vehicle, now=now)
        self._tell(sender, vehicle, refusal.text, now=now)
        self._book.record(
            SubmissionRefused(
                vehicle.system_id,
                MavCmd.MISSION_START,
                TaskReason(refusal.reason),
                refusal.text,
                str(sender.address),
                now,
            )
        )

    def _draft(self, vehicle: Vehicle, plan: Plan, terms: Terms, sender: Sender) -> Draft:
        client = self._client(sender)
        assert client is not None, "it has just spoken"
        what = f"{sender.addressed} {plan.source}".encode()
        marks = Marks(0, blake2b(what, digest_size=9).hexdigest(), "")
        submitter = client.submitter(sender.address)
        return Draft(
            vehicle.system_id, MavCmd.MISSION_START, plan, submitter, terms=terms, marks=marks
        )

    # clearing

    def _clear(self, vehicle: Vehicle, sender: Sender, kind: int, *, now: float) -> None:
        kinds: list[int] = list(STORED) if kind == MavMissionType.ALL else [kind]
        if kinds[0] not in STORED:
            self._ack(sender, kind, MavMissionResult.UNSUPPORTED)
            return
        task = self._plans.task(vehicle)
        if MISSION in kinds and task is not None and task.state in ACTIVE:
            self._ack(sender, kind, MavMissionResult.DENIED)
            words = f"task {task.id} has begun: cancel it first"
            self._tell(sender, vehicle, words, now=now)
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
        """One kind after the other, what the vehicle keeps first there; then the answer."""
        actor = str(sender.address)
        if not kinds:
            task = self._book.get(TaskId(before[MISSION].plan_id)) if MISSION in before else None

            def accept(*, now: float) -> None:
                self._end(vehicle, task, R.CLEARED, actor, now=now)
                self._ack(sender, asked, MavMissionResult.ACCEPTED)

            def give_up(*, now: float) -> None:
                for kind, stored in before.items():
                    self._plans.keep(vehicle, kind, stored, actor=actor, now=now)
                self._ack(sender, asked, MavMissionResult.ERROR)

            self._submissions.when_durable(accept, give_up, now=now)
            return
        first, rest = kinds[0], kinds[1:]

        def go_on(*, now: float) -> None:
            so_far = {**before, first: self._plans.stored(vehicle.system_id, first)}
            self._plans.keep(vehicle, first, NOTHING, actor=actor, now=now)
            self._forget(vehicle, sender, asked, rest, so_far, now=now)

        def refuse(refusal: Rejection, *, now: float) -> None:
            self._ack(sender, asked, result_of(refusal))
            self._tell(sender, vehicle, refusal.text, now=now)

        if first == MISSION:
            go_on(now=now)
        else:
            self._write_through(vehicle, first, (), go_on, refuse, now=now)

    def _set_current(
        self, vehicle: Vehicle, client: GcsClient, sender: Sender, seq: int, *, now: float
    ) -> None:
        """The message MISSION_SET_CURRENT; MAVSDK waits for this very number, for ever."""
        try:
            self._plans.go_on_with(vehicle, seq, now=now)
        except Rejection as refusal:
            self._tell(sender, vehicle, refusal.text, now=now)
        client.outlet.send(
            self._plans.current(vehicle, seq=seq), Address(vehicle.system_id, AUTOPILOT)
        )
