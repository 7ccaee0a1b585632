"""Plans that clients upload, look at, start and clear; what is uploaded to be driven is a task.

To the autopilot's address goes one mission, which waits until it is started, as on an autopilot; to
the task server's go as many as one likes, each queued at once. Fence and rally points are the
vehicle's, whichever address they were sent to.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from hashlib import blake2b
from zlib import crc32

from mav_tasks.engine.gcs_client import GcsClient
from mav_tasks.engine.gcs_side import GcsSide
from mav_tasks.engine.motion_gate import GO_TO
from mav_tasks.engine.plan_items import plan_of, result_of, step_of
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
from mav_tasks.tasks.events import PlanStored, SubmissionRefused
from mav_tasks.tasks.goal import Plan
from mav_tasks.tasks.lifecycle import TERMINAL, WAITING, TaskReason, TaskState
from mav_tasks.tasks.task import Draft, Marks, Submitter, Task, TaskId, Terms

R, S = TaskReason, TaskState

MISSION = MavMissionType.MISSION
STORED = (MavMissionType.MISSION, MavMissionType.FENCE, MavMissionType.RALLY)
STARTED_TWICE = 2.5  # s in which a second wish to start means the first: MAVSDK sends two
#: queues that a start does not set going again: a person must have said that all is well
NOT_CONTINUED = frozenset({R.STOPPED, R.TAKEOVER})

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


@dataclass(frozen=True, slots=True)
class Stored:
    """A plan as it came, and the id by which clients know it."""

    plan_id: int
    items: tuple[Item, ...]


NOTHING = Stored(0, ())


class _Desk:
    """Uploads to, and downloads from, one address."""

    def __init__(self, receiver: MissionReceiver) -> None:
        self.receiver = receiver
        self.sender = MissionSender()


@dataclass(slots=True)
class _Started:
    by: Submitter
    at: float
    task: Task


class Plans:
    """The plans of all vehicles."""

    def __init__(
        self,
        gcs: GcsSide,
        vehicles: VehicleSide,
        book: TaskBook,
        submissions: Submissions,
        settings: Settings,
        *,
        restored: Mapping[tuple[int, int], tuple[int, str]],
    ) -> None:
        self._gcs = gcs
        self._vehicles = vehicles
        self._book = book
        self._submissions = submissions
        self._settings = settings
        self._stored = {
            key: Stored(plan_id, unpacked(source)) for key, (plan_id, source) in restored.items()
        }
        self._desks: dict[tuple[int, int], _Desk] = {}
        self._first: dict[int, int] = {}  # by vehicle: the item with which the next start begins
        self._started: dict[int, _Started] = {}
        self._why = ""  # an item was refused, in words

    def apply(self, settings: Settings) -> None:
        """Take new settings."""
        self._settings = settings

    def stored(self, vehicle: int, kind: int) -> Stored:
        """Give a vehicle's mission, fence or rally points."""
        return self._stored.get((vehicle, kind), NOTHING)

    def shown(self, vehicle: Vehicle) -> Task | None:
        """Give the mission that clients are shown: the one that is driven, else the staged."""
        begun = vehicle.tasks.begun
        if begun is not None and isinstance(begun.goal, Plan):
            return begun
        return self._task(vehicle)

    def _task(self, vehicle: Vehicle) -> Task | None:
        """Give the task that the staged mission is, while it is remembered."""
        return self._book.get(TaskId(self.stored(vehicle.system_id, MISSION).plan_id))

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
                present = self._downloadable(vehicle, component, kind).items
                self._send(desk.sender.request(sender, kind, seq, present, now=now))
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
            check = partial(self._check, vehicle, component)
            desk = self._desks[key] = _Desk(MissionReceiver(check=check))
        return desk

    def _flush(self, desk: _Desk, vehicle: Vehicle, *, now: float) -> None:
        outgoing, uploads = desk.receiver.take()
        for told in outgoing:
            self._send(told)
            if self._why and isinstance(told.message, m.MissionAck):
                self._tell(told.sender, vehicle, self._why, now=now)
                self._why = ""
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

    def _check(
        self,
        vehicle: Vehicle,
        component: int,
        kind: int,
        seq: int,
        item: Item,
        count: int,
    ) -> MavMissionResult | None:
        """Whether an item can be part of a plan; keeps why not in words."""
        if kind not in STORED:
            return MavMissionResult.UNSUPPORTED
        if kind != MISSION:
            return None
        has_home = vehicle.persona.has_home_item and component == AUTOPILOT
        driving = self._settings.driving
        try:
            step_of(item, seq, count=count, has_home=has_home, driving=driving)
        except Rejection as refusal:
            self._why = refusal.text
            return result_of(refusal)
        return None

    def _downloadable(self, vehicle: Vehicle, component: int, kind: int) -> Stored:
        """What an address has to show: the task server, of missions, the one that is driven."""
        begun = vehicle.tasks.begun
        if kind == MISSION and component != AUTOPILOT and begun and isinstance(begun.goal, Plan):
            return Stored(begun.id, unpacked(begun.goal.source))
        return self.stored(vehicle.system_id, kind)

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
            if upload.mission_type != MISSION or not upload.items:
                self._replace(desk, vehicle, upload, now=now)
            else:
                self._take_in(desk, vehicle, upload, now=now)
        except Rejection as refusal:
            self._refuse(desk, vehicle, upload.sender, refusal, now=now)

    def _take_in(self, desk: _Desk, vehicle: Vehicle, upload: Upload, *, now: float) -> None:
        """A mission: a task that waits to be started, or is queued."""
        sender = upload.sender
        is_staged = sender.addressed.component_id == AUTOPILOT
        has_home = vehicle.persona.has_home_item and is_staged
        driving = self._settings.driving
        wanted = plan_of(upload.items, has_home=has_home, driving=driving, now=now)
        terms = replace(wanted.terms, is_staged=is_staged)
        draft = self._draft(vehicle, wanted.plan, terms, sender)
        known = None if is_staged else self._submissions.known_plan(draft, now=now)
        if known is not None:
            desk.receiver.finish(MavMissionResult.ACCEPTED, opaque_id=known, now=now)
            self._flush(desk, vehicle, now=now)
            words = f"same plan again: still task {known}"
            self._tell(sender, vehicle, words, now=now)
            return
        before = self.stored(vehicle.system_id, MISSION)
        task = self._submissions.submit_plan(vehicle, draft, now=now)
        if is_staged:
            self._keep(vehicle, MISSION, Stored(task.id, upload.items), sender, now=now)
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
        if task.terms.is_staged and replaced is not None and _waits_for_start(replaced):
            self._end(vehicle, replaced, R.REPLACED, sender, now=now)
        if task.terms.is_staged:
            self._first.pop(vehicle.system_id, None)
        what = "ready to be started" if task.terms.is_staged else "queued"
        words = f"Task {task.id} {what}: plan of {len(_plan(task).steps)} items"
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
            self._keep(vehicle, MISSION, before, sender, now=now)
        refusal = Rejection(R.STORE_UNAVAILABLE, "not stored in time: not accepted")
        self._refuse(desk, vehicle, sender, refusal, now=now)

    def _replace(self, desk: _Desk, vehicle: Vehicle, upload: Upload, *, now: float) -> None:
        """Fence and rally points, and the empty mission: nothing that is driven."""
        kind, sender = upload.mission_type, upload.sender
        if kind == MISSION:
            self._forget_mission(vehicle, sender, now=now)
        plan_id = crc32(packed(upload.items).encode()) if upload.items else 0
        self._keep(vehicle, kind, Stored(plan_id, upload.items), sender, now=now)

        def accept(*, now: float) -> None:
            desk.receiver.finish(MavMissionResult.ACCEPTED, opaque_id=plan_id, now=now)
            self._flush(desk, vehicle, now=now)

        def give_up(*, now: float) -> None:
            refusal = Rejection(R.STORE_UNAVAILABLE, "not stored in time")
            self._refuse(desk, vehicle, sender, refusal, now=now)

        self._submissions.when_durable(accept, give_up, now=now)

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

    def _keep(
        self, vehicle: Vehicle, kind: int, stored: Stored, sender: Sender, *, now: float
    ) -> None:
        self._stored[vehicle.system_id, kind] = stored
        self._book.record(
            PlanStored(
                vehicle.system_id,
                kind,
                stored.plan_id,
                packed(stored.items),
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
        kinds = list(STORED) if kind == MavMissionType.ALL else [kind]
        if kinds[0] not in STORED:
            self._ack(sender, kind, MavMissionResult.UNSUPPORTED)
            return
        begun = vehicle.tasks.begun
        stored = self.stored(vehicle.system_id, MISSION)
        if MISSION in kinds and begun is not None and begun.id == stored.plan_id:
            self._ack(sender, kind, MavMissionResult.DENIED)
            self._tell(sender, vehicle, f"task {begun.id} is being driven", now=now)
            return
        if MISSION in kinds:
            self._forget_mission(vehicle, sender, now=now)
        for each in kinds:
            if self.stored(vehicle.system_id, each).plan_id:
                self._keep(vehicle, each, NOTHING, sender, now=now)

        def answer(result: MavMissionResult, *, now: float) -> None:
            del now
            self._ack(sender, kind, result)

        self._submissions.when_durable(
            partial(answer, MavMissionResult.ACCEPTED),
            partial(answer, MavMissionResult.ERROR),
            now=now,
        )

    def _forget_mission(self, vehicle: Vehicle, sender: Sender, *, now: float) -> None:
        task = self._task(vehicle)
        if task is not None and _waits_for_start(task):
            self._end(vehicle, task, R.CLEARED, sender, now=now)
        self._first.pop(vehicle.system_id, None)

    def _end(
        self, vehicle: Vehicle, task: Task, reason: TaskReason, sender: Sender, *, now: float
    ) -> None:
        actor = str(sender.address)
        vehicle.tasks.cancel(task, kill=False, reason=reason, actor=actor, now=now)

    # starting and jumping

    def start(
        self, vehicle: Vehicle, submitter: Submitter, *, first: int, now: float
    ) -> Task | Draft:
        """Start or continue the staged mission.

        Gives the task; or, when that is over, the draft of another one to be submitted, after
        which ``restarted`` is called. Rejection when there is nothing to start, or it must not be.
        """
        stored = self.stored(vehicle.system_id, MISSION)
        if not stored.items:
            raise Rejection(R.NOT_FOUND, "no plan is uploaded")
        if first >= len(stored.items):
            words = f"param1 first item {first}: there are {len(stored.items)}"
            raise Rejection(R.BAD_PARAMETER, words, param=1)
        started = self._started.get(vehicle.system_id)
        if started and started.by == submitter and now - started.at <= STARTED_TWICE:
            return self._book.get(started.task.id) or started.task
        if vehicle.tasks.paused in NOT_CONTINUED:
            words = "STOP is latched" if vehicle.tasks.is_stopped else "somebody took it over"
            raise Rejection(R.QUEUE_PAUSED, f"{words}: continue first")
        task = self._task(vehicle)
        if task is None or task.state in TERMINAL:
            return self._again(vehicle, stored, submitter, first=first, now=now)
        actor = str(submitter)
        if vehicle.tasks.paused:
            vehicle.proceed(actor=actor, now=now)
        if _waits_for_start(task):
            first = first or self._first.pop(vehicle.system_id, 0)
            if first:
                vehicle.tasks.skip_to(task, first, now=now)
            vehicle.modify(
                self._book[task.id], replace(task.terms, is_staged=False), actor=actor, now=now
            )
            vehicle.wake(now=now)
        self._note_start(vehicle, submitter, task, now=now)
        return task

    def restarted(self, vehicle: Vehicle, task: Task, *, now: float) -> None:
        """The mission was submitted anew: clients know it by that task's id from now on."""
        stored = self.stored(vehicle.system_id, MISSION)
        client = Address(task.submitter.system_id, task.submitter.component_id)
        sender = Sender(None, client, Address(vehicle.system_id, AUTOPILOT))
        self._keep(vehicle, MISSION, replace(stored, plan_id=task.id), sender, now=now)
        self._note_start(vehicle, task.submitter, task, now=now)

    def _note_start(
        self, vehicle: Vehicle, submitter: Submitter, task: Task, *, now: float
    ) -> None:
        self._started[vehicle.system_id] = _Started(submitter, now, task)

    def _again(
        self, vehicle: Vehicle, stored: Stored, submitter: Submitter, *, first: int, now: float
    ) -> Draft:
        wanted = plan_of(
            stored.items,
            has_home=vehicle.persona.has_home_item,
            driving=self._settings.driving,
            now=now,
        )
        first = first or self._first.pop(vehicle.system_id, 0)
        plan = replace(wanted.plan, first=first)
        command = MavCmd.MISSION_START
        return Draft(vehicle.system_id, command, plan, submitter, terms=wanted.terms)

    def go_on_with(self, vehicle: Vehicle, seq: int, *, now: float) -> Task | None:
        """Let the mission go on, or begin, with another item; Rejection: it cannot."""
        task = self.shown(vehicle)
        count = len(self.stored(vehicle.system_id, MISSION).items)
        if task is not None and isinstance(task.goal, Plan) and task.state not in TERMINAL:
            count = len(task.goal.steps)
        if seq >= count:
            raise Rejection(R.BAD_PARAMETER, f"item {seq}: there are {count}", param=1)
        if task is None or task.state in TERMINAL:
            self._first[vehicle.system_id] = seq
            return None
        vehicle.tasks.skip_to(task, seq, now=now)
        return task

    def _set_current(
        self, vehicle: Vehicle, client: GcsClient, sender: Sender, seq: int, *, now: float
    ) -> None:
        """The message MISSION_SET_CURRENT; MAVSDK waits for this very number, for ever."""
        try:
            self.go_on_with(vehicle, seq, now=now)
        except Rejection as refusal:
            self._tell(sender, vehicle, refusal.text, now=now)
        client.outlet.send(self.current(vehicle, seq=seq), Address(vehicle.system_id, AUTOPILOT))

    # showing

    def current(self, vehicle: Vehicle, *, seq: int | None = None) -> m.MissionCurrent:
        """Give MISSION_CURRENT; ``seq`` instead of the item that is driven."""
        task, system_id = self.shown(vehicle), vehicle.system_id
        stored = self.stored(system_id, MISSION)
        count = len(stored.items)
        if task is not None and isinstance(task.goal, Plan):
            count = len(task.goal.steps)
        at = self._first.get(system_id, 0)
        if task is not None and task.progress.step >= 0:
            at = min(task.progress.step, max(count - 1, 0))
        return m.MissionCurrent(
            at if seq is None else seq,
            count,
            _mission_state(task, has_plan=bool(count)),
            0,
            stored.plan_id if task is None else task.id,
            self.stored(system_id, MavMissionType.FENCE).plan_id,
            self.stored(system_id, MavMissionType.RALLY).plan_id,
        )

    def item_of(self, task: Task, step: int) -> Item:
        """Give an item of a task's plan as it came."""
        return unpacked(_plan(task).source)[step]


def _plan(task: Task) -> Plan:
    assert isinstance(task.goal, Plan), "the task of a mission is a plan"
    return task.goal


def _waits_for_start(task: Task) -> bool:
    return task.state in WAITING and task.terms.is_staged


def _mission_state(task: Task | None, *, has_plan: bool) -> int:
    """Give the MISSION_STATE."""
    if not has_plan:
        return 1  # NO_MISSION
    match None if task is None else task.state:
        case S.STARTING | S.EXECUTING:
            return 3  # ACTIVE
        case S.PAUSED | S.HELD | S.CANCELLING:
            return 4  # PAUSED
        case S.COMPLETED:
            return 5  # COMPLETE
        case _:
            return 2  # NOT_STARTED
