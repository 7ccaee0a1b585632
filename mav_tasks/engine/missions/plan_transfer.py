"""What becomes of a plan that was uploaded: it is checked, refused, submitted or stored.

The autopilot's address has one mission, which is staged until it is started, as on an autopilot.
The task server's address takes any number; each is queued at once. Fence and rally points belong to
the vehicle, at either address. A plan at the server's own address becomes a task of the vehicle
that it chooses. An upload is refused at the first bad item, so that its client learns which one it
is, and acknowledged when it is durable.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from hashlib import blake2b
from math import inf
from typing import Protocol
from zlib import crc32

from mav_tasks.basics.errors import Rejection
from mav_tasks.config.settings import Settings
from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.commands.ability import check_reach
from mav_tasks.engine.commands.assignments import check_any, driven_by
from mav_tasks.engine.commands.command_request import CommandRequest, row_said
from mav_tasks.engine.commands.submissions import chosen_words
from mav_tasks.engine.inputs import NonceTaken
from mav_tasks.engine.missions.plan_items import (
    ParsedMission,
    check_fence_item,
    check_rally_item,
    fence_for_vehicle,
    fence_of,
    plan_of,
    result_of,
    skipped,
    step_of,
    steps_of,
)
from mav_tasks.engine.missions.plan_table import MissionParseOptions
from mav_tasks.engine.missions.plans import (
    AT_REST,
    MISSION,
    STORED,
    Stored,
    is_of_autopilot,
)
from mav_tasks.engine.missions.transfer import MissionParts, Sender, Transfer, Upload
from mav_tasks.engine.policy import GO_TO, row_of
from mav_tasks.engine.services.commands import NO_MESSAGE, Command
from mav_tasks.engine.services.missions import Item, item_of, packed, unpacked
from mav_tasks.engine.timers import Effect
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.kinds import GoTo
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavCmd, MavMissionResult, MavMissionType, MavResult, MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.tasks.deduplicator import reused
from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.goal import Plan, Step, number_of
from mav_tasks.tasks.lifecycle import ACTIVE, TERMINAL, TaskReason, TaskState
from mav_tasks.tasks.task import ANY, Draft, Marks


class GuidedItemRequest(CommandRequest):
    """A request by mission item, answered with a MISSION_ACK."""

    @property
    def is_go_to(self) -> bool:
        """True: the item is always a "go to"."""
        return True

    def answer(self, result: MavResult, result_param2: int = 0) -> None:
        """Send the MISSION_ACK of an accepted item; ``refuse`` sends all others."""
        if result is MavResult.ACCEPTED:
            self._ack(MavMissionResult.ACCEPTED, result_param2)

    def refuse(
        self, refusal: Rejection, *, now: float, result: MavResult | None = None
    ) -> SubmissionRefused:
        """Answer with the result and a text; return the event for the audit log."""
        self._ack(result_of(refusal))
        return super().refuse(refusal, result=result, now=now)

    def _ack(self, result: MavMissionResult, opaque_id: int = 0) -> None:
        ack = m.MissionAck(*self.packet.source, result, MavMissionType.MISSION, opaque_id)
        self.client.outlet.send(ack, self.answering)


R = TaskReason


UploadMessage = m.MissionCount | m.MissionItem | m.MissionItemInt | m.MissionAck
#: messages of the mission protocol from clients
MissionMessage = (
    UploadMessage
    | m.MissionRequestList
    | m.MissionRequest
    | m.MissionRequestInt
    | m.MissionClearAll
    | m.MissionSetCurrent
    | m.MissionRequestPartialList
    | m.MissionWritePartialList
)

ONLY_HIGHER = 3  # MISSION_ITEM.current; 2 is a place to go to
NOWHERE = (0.0, 0.0, 0.0, 0.0, inf, inf, 0.0)  # parameters of an item beyond all numbers
GIVES_UP = 3.0  # s without MISSION_CURRENT, after which MAVSDK has taken a refusal in


class Answer(Protocol):
    """Answers a client: with a plan's id, or a refusal."""

    def __call__(self, answer: Rejection | int, /, *, now: float) -> object: ...


#: a vehicle's results after which the next plan goes to it: it took this one, or cannot have such
WRITTEN = frozenset({MavMissionResult.ACCEPTED, MavMissionResult.UNSUPPORTED})


class Written(Protocol):
    """Is told the last result of a vehicle, None without an answer, and how often it was asked."""

    def __call__(self, result: MavMissionResult | None, *, asked: int, now: float) -> None: ...


class PlanTransfer(Transfer):
    """The plans of one type at one address."""

    def receive(
        self, client: GcsClient, packet: Packet, message: MissionMessage, *, now: float
    ) -> None:
        """Handle a client's message."""
        sender = Sender(client.key, client.signed_by.name, packet.source)
        row = row_of(packet.message_id, message)
        is_go_to = self.vehicle is not None and getattr(message, "current", 0) in GO_TO
        try:
            if not isinstance(message, m.MissionSetCurrent) and not is_go_to:
                client.rights.require(row.role, f"do this ({row.about})")
            match message:
                case m.MissionCount():
                    self.begin(message, sender, client=client, now=now)
                case m.MissionAck():
                    self.end(message, sender, now=now)
                case m.MissionItem() | m.MissionItemInt() if is_go_to:
                    self._go_to(client, packet, message, now=now)
                case m.MissionItem() | m.MissionItemInt():
                    self.take(message, sender, client=client, now=now)
                case m.MissionRequestList():
                    self.offer(sender, now=now)
                case m.MissionRequest() | m.MissionRequestInt():
                    self.give(sender, message, now=now)
                case m.MissionRequestPartialList() | m.MissionWritePartialList():
                    self.ack(sender, MavMissionResult.UNSUPPORTED)
                case m.MissionClearAll():
                    self._clear(sender, is_late=client.is_late, now=now)
                case m.MissionSetCurrent():
                    self._jump(client, sender, message.seq, now=now)
        except Rejection as refusal:
            match message:
                case m.MissionCount():
                    self.answer(sender, refusal, now=now)
                case m.MissionClearAll():
                    self.answer(sender, refusal, message_id=message.id, now=now)
                case m.MissionSetCurrent():
                    self.tell_refusal(sender, refusal, message_id=message.id, now=now)
                    # MAVSDK asks again at each MISSION_CURRENT with another number, for ever; after
                    # 2.5 s without any it gives up. An ArduPilot (4.6.3) does not answer, either.
                    client.gives_up_at = now + GIVES_UP
        self.plan_timer()

    @property
    def _vehicle(self) -> Vehicle:
        """The vehicle of these plans, in order to change it."""
        assert self.vehicle is not None, "plans for any vehicle are only uploaded"
        self.parts.vehicles.mark_dirty(self.vehicle)
        return self.vehicle

    def present(self) -> Stored:
        """Return the plan to download; the task server's mission is the active one, if any."""
        active = self.vehicle.tasks.active if self.vehicle else None
        if self.kind == MISSION and not self.is_staged and active and isinstance(active.goal, Plan):
            return Stored(active.id, active.goal.source)
        return self.parts.plans.stored(self.address.system_id, self.kind)

    def check(self, upload: Upload, item: Item) -> None:
        """Raise Rejection if an item may not be the next one of an upload."""
        seq = len(upload.items)
        if self.kind == MavMissionType.FENCE:
            check_fence_item(item, seq, count=upload.count)
        elif self.kind == MavMissionType.RALLY:
            check_rally_item(item, seq)
        else:
            manner = self._manner_of(upload)
            step = step_of(item, seq, count=upload.count, manner=manner)
            if isinstance(step, GoTo):
                name = f"item {number_of(seq, has_home=manner.has_home)}"
                self._check_place(step, upload.steps, name)
            upload.steps.append(step)

    def _manner_of(self, upload: Upload) -> MissionParseOptions:
        """Return how the items are parsed; parse them again if that has changed meanwhile."""
        persona = self.vehicle.persona if self.vehicle else None
        driving = self.parts.settings.driving
        manner = MissionParseOptions.of(persona, is_staged=self.is_staged, driving=driving)
        if manner != upload.parsed_by:
            upload.parsed_by = manner
            upload.steps = steps_of(upload.items, count=upload.count, manner=manner)
        return manner

    def _check_place(self, step: GoTo, earlier: list[Step], name: str) -> None:
        """Raise Rejection for a place too far away, outside the fence, or reached across it."""
        if self.vehicle is None:
            check_any(step, name=f"{name}: ")
            return
        check_reach(self.vehicle, step, name=name, param=5)
        steps: list[Step] = [step]
        for before in reversed(earlier):  # back to the last place
            steps.insert(0, before)
            if isinstance(before, GoTo):
                break
        if self.vehicle.where.leg_over_fence(steps) is not None:
            raise Rejection(R.OUTSIDE_FENCE, f"{name}: the path to it crosses the fence")

    def _parsed(self, upload: Upload, *, now: float) -> ParsedMission:
        """Return the plan of a whole upload. Raise Rejection if it makes none."""
        has_home = self._manner_of(upload).has_home
        parsed = plan_of(upload.items, upload.steps, has_home=has_home, now=now)
        vehicle, plan = self.vehicle, parsed.plan
        forbidden = None if vehicle is None else vehicle.where.leg_over_fence(plan.steps)
        if forbidden is not None:
            words = f"item {plan.item_number(forbidden)}: a jump to it crosses the fence"
            raise Rejection(R.OUTSIDE_FENCE, words)
        return parsed

    def decide(self, upload: Upload, *, now: float) -> None:
        """Submit or store a whole upload, and ``finish`` it. Raise Rejection if it is refused."""
        vehicle, sender, items = self.vehicle, upload.sender, tuple(upload.items)
        self.parts.submissions.check_open()
        client = self.client(sender)
        if client is None:
            raise Rejection(R.WRONG_STATE, "the client has gone")
        if self.kind == MISSION:
            only_home = vehicle.persona.has_home_item and self.is_staged if vehicle else -1
            if len(items) > only_home:
                self._submit(client, upload, now=now)
                return
            items = ()
            task = self.parts.plans.task(self._vehicle)
            if task is not None and task.state in ACTIVE:
                raise Rejection(R.NOT_ALLOWED, f"task {task.id} has started: cancel it first")
            self._check_own(upload)
        self._store([self.kind], items, sender, self.finish, now=now)

    def _check_own(self, upload: Upload) -> None:
        """Raise Rejection if an upload may not replace, or remove, the staged mission."""
        task = self.parts.plans.task(self._vehicle)
        if task is not None and task.state not in TERMINAL:
            upload.rights.require_own(task, upload.submitter, "replace that plan")

    def _submit(self, client: GcsClient, upload: Upload, *, now: float) -> None:
        """Submit a mission as a task, staged or queued."""
        parts, is_staged = self.parts, self.is_staged
        vehicle = self._vehicle if self.vehicle else None
        submissions, plans, address = parts.submissions, parts.plans, upload.sender.address
        plan, terms, nonce = self._parsed(upload, now=now)
        draft = Draft(
            ANY if vehicle is None else vehicle.system_id,
            MavCmd.MISSION_START,
            plan,
            upload.submitter,
            replace(terms, is_staged=is_staged, is_cruising=is_staged),
            Marks(  # two of one content differ by their nonces
                0 if is_staged else nonce,
                blake2b(f"{self.address} {plan.source}".encode(), digest_size=9).hexdigest(),
            ),
        )
        upload.rights.check_content(draft)
        if not is_staged:
            # a long plan may come again later than submissions are remembered
            known = submissions.known_plan(draft, begun_at=upload.begun_at, now=now)
            if known is not None:
                self.finish(known, now=now)
                words = f"repeated plan, no new task: see task {known}"
                client.tell(words, MavSeverity.WARNING, self.address, now=now)
                return
        again = partial(self.decide_or_refuse, upload)
        if submissions.questions.hold(terms.after, again, self.finish, now=now):
            return
        if vehicle is None:
            choice = parts.assignments.choose(plan, now=now)
            vehicle = parts.vehicles.get(choice.vehicle)
            assert vehicle is not None, "it was chosen among them"
            goal = driven_by(vehicle, plan)
            draft = replace(draft, vehicle=choice.vehicle, goal=goal, choice=choice.words)
        halts = vehicle.tasks.halts
        if not is_staged and upload.begun_at < halts.at:
            raise Rejection(R.STALE, f"{halts.words} came during the upload: upload it again")
        before, actor = plans.stored(vehicle.system_id, MISSION), str(address)
        finish: Answer = self.finish
        if is_staged:
            self._check_own(upload)
            self._check_alone([MISSION])
        task = submissions.submit_plan(upload.rights, vehicle, draft, now=now)
        if is_staged:
            finish = self._alone([MISSION], upload.sender, finish)
            plans.keep(vehicle, MISSION, Stored(task.id, plan.source), actor=actor, now=now)

        def accept(*, now: float) -> None:
            if parts.registry.get(task.id) is None:
                return  # retracted, and answered
            parts.vehicles.mark_dirty(vehicle)  # a task may start
            what, last = "queued", parts.registry.recorded
            if is_staged:
                plans.end_replaced(vehicle, is_started=False, actor=actor, now=now)
                plans.begin_at(vehicle, 0)
                what = "ready to start"
                active = vehicle.tasks.active
                if active is not None and is_of_autopilot(active) and not vehicle.tasks.paused:
                    what += f", task {active.id} goes on until then"
            words = f"Task {task.id} {what}: {task.goal.words}{skipped(task.goal)}"
            words += chosen_words(task)

            def acknowledge(*, now: float) -> None:
                finish(task.id, now=now)
                parts.gcs.tell(words, MavSeverity.INFO, vehicle.server_address, now=now)

            self._once_ended(last, acknowledge, finish, now=now)

        def withdraw(*, now: float) -> None:
            if parts.registry.get(task.id) is None:
                return  # retracted, and answered
            parts.vehicles.mark_dirty(vehicle)
            submissions.take_back(vehicle, task, now=now)
            if is_staged:
                plans.keep(vehicle, MISSION, before, actor=actor, now=now)
            finish(Rejection(R.STORE_UNAVAILABLE, "not stored in time: not accepted"), now=now)

        submissions.gate.hold(accept, withdraw, now=now)

    def _check_alone(self, kinds: Sequence[int]) -> None:
        """Raise Rejection while plans of these types are being stored.

        What is not stored in time gives way to the plan before it: that must be a stored one.
        """
        if any((self._vehicle.system_id, kind) in self.parts.storing for kind in kinds):
            raise Rejection(R.WRONG_STATE, "another change of that plan is being stored: wait")

    def _alone(
        self, kinds: Sequence[int], sender: Sender, answer: Answer, *, clears: bool = False
    ) -> Answer:
        """Keep other changes of these plans out until the returned answer is given."""
        storing, rover = self.parts.storing, self._vehicle.system_id
        storing.update(((rover, kind), (sender, clears)) for kind in kinds)

        def end(given: Rejection | int, /, *, now: float) -> None:
            for kind in kinds:
                storing.pop((rover, kind), None)
            answer(given, now=now)

        return end

    def _once_ended(self, last: int, accept: Effect, answer: Answer, *, now: float) -> None:
        """Do ``accept`` once it is durable that missions have ended: all events after ``last``.

        They end only once the plan in their place is stored, because that cannot be undone. Killed
        after an earlier acknowledgement, the server would drive one of them on.
        """
        if self.parts.registry.recorded == last:
            accept(now=now)
            return

        def refuse(*, now: float) -> None:
            words = "not stored in time that the earlier mission has ended: send it again"
            answer(Rejection(R.STORE_UNAVAILABLE, words), now=now)

        self.parts.submissions.gate.hold(accept, refuse, now=now)

    def _go_to(
        self,
        client: GcsClient,
        packet: Packet,
        message: m.MissionItem | m.MissionItemInt,
        *,
        now: float,
    ) -> None:
        """Submit a "go to". An item that only changes the altitude is accepted without effect."""
        item = item_of(message)
        params = NOWHERE if item is None else item.params
        command = Command(self.address, message.command, params, 0, message.frame, NO_MESSAGE)
        said = client.sender.take_in(command, packet.raw, now=now)
        asked = GuidedItemRequest(client, self._vehicle, packet, said, row_said(command))
        try:
            if message.current == ONLY_HIGHER:
                asked.answer(MavResult.ACCEPTED)
                return
            if message.command != MavCmd.NAV_WAYPOINT:
                words = f"command {message.command} is not a place"
                raise Rejection(R.NOT_SUPPORTED_BY_VEHICLE, words)
            self.parts.submissions.submit(asked, now=now)
        except Rejection as refusal:
            if client.may_be_refused(now=now):
                self.parts.registry.record(asked.refuse(refusal, now=now))

    def _jump(self, client: GcsClient, sender: Sender, seq: int, *, now: float) -> None:
        """Handle MISSION_SET_CURRENT. Raise Rejection if it is refused."""
        plans, vehicle = self.parts.plans, self._vehicle
        plans.check_start(client.rights, vehicle, client.submitter(sender.address))
        if plans.go_on_with(vehicle, seq, now=now) is None:
            words = plans.begins_with(vehicle, seq)
            client.tell(words, MavSeverity.INFO, vehicle.server_address, now=now)
        current = plans.current(vehicle, seq=seq)
        client.outlet.send(current, Address(vehicle.system_id, AUTOPILOT))

    def _clear(self, sender: Sender, *, is_late: bool, now: float) -> None:
        """Handle MISSION_CLEAR_ALL, of one type or of all; answer once that is durable.

        ``is_late``: the message waited while the server was stalled. A held mission is then not
        cleared, because the next tasks would start. Raise Rejection if it is refused.
        """
        kinds: Sequence[int] = STORED if self.kind == MavMissionType.ALL else [self.kind]
        if not set(kinds) <= set(STORED):
            self.ack(sender, MavMissionResult.UNSUPPORTED)
            return
        plans, vehicle = self.parts.plans, self._vehicle
        task = plans.task(vehicle) if MISSION in kinds else None
        if task is not None and task.state in ACTIVE - AT_REST:
            words = f"clear: task {task.id} is being driven: pause or cancel it first"
            raise Rejection(R.WRONG_STATE, words)
        if task is not None and is_late and task.state is TaskState.HELD:
            words = f"clear: delayed by the server; task {task.id} is held now: clear again"
            raise Rejection(R.STALE, words)
        storing = {self.parts.storing.get((vehicle.system_id, kind)) for kind in kinds}
        if storing - {None} == {(sender, True)}:
            return  # it was repeated, and will be answered
        stored = partial(plans.stored, vehicle.system_id)
        left = [kind for kind in kinds if kind == MISSION or stored(kind).plan_id]
        answer = partial(self.answer, sender, message_id=m.MissionClearAll.id)
        self._store(left, (), sender, answer, clears=True, now=now)

    def _store(
        self,
        kinds: list[int],
        items: tuple[Item, ...],
        sender: Sender,
        answer: Answer,
        *,
        clears: bool = False,
        now: float,
    ) -> None:
        """Store one plan for each of these types: an empty mission, fence or rally points.

        The vehicle gets the bounds first, which it enforces without the server. If it does not
        support them, they are stored; if it refuses them or does not answer, nothing is. If nothing
        is stored, it gets the earlier ones back. Raise Rejection if they are no valid fence: the
        one before stays in force.
        """
        parts, vehicle, actor = self.parts, self._vehicle, str(sender.address)
        plans, source = parts.plans, packed(items)
        plan, rover = Stored(crc32(source.encode()), source), f"rover {vehicle.system_id}"
        bounds = [kind for kind in kinds if kind != MISSION]
        if MavMissionType.FENCE in kinds:
            fence_of(items)
        self._check_alone(kinds)
        answer = self._alone(kinds, sender, answer, clears=clears)

        def written(result: MavMissionResult | None, *, asked: int, now: float) -> None:
            if result in WRITTEN:
                store(now=now)
                return
            refusal = Rejection(R.VEHICLE_SILENT, f"{rover} did not answer: not stored")
            if result is not None:
                refusal = Rejection(R.NOT_ALLOWED, f"{rover} refused it: {result.name}")
            put_back(bounds[: asked - 1], refusal, now=now)

        def store(*, now: float) -> None:
            before = {kind: plans.stored(vehicle.system_id, kind) for kind in kinds}
            for kind in kinds:
                plans.keep(vehicle, kind, plan, actor=actor, now=now)

            def accept(*, now: float) -> None:
                parts.vehicles.mark_dirty(vehicle)
                last = parts.registry.recorded

                def acknowledge(*, now: float) -> None:
                    answer(plan.plan_id, now=now)

                if MISSION in kinds:
                    plans.let_go(vehicle, before[MISSION].plan_id, actor=actor, now=now)
                    # also one that a crash has left, between a plan and the end of the one before
                    plans.end_replaced(vehicle, is_started=False, actor=actor, now=now)
                self._once_ended(last, acknowledge, answer, now=now)

            def give_up(*, now: float) -> None:
                for kind, stored in before.items():
                    plans.keep(vehicle, kind, stored, actor=actor, now=now)
                words = "not stored in time: nothing changed"
                put_back(bounds, Rejection(R.STORE_UNAVAILABLE, words), now=now)

            parts.submissions.gate.hold(accept, give_up, now=now)

        def put_back(taken: list[int], refusal: Rejection, *, now: float) -> None:
            """Refuse, once the vehicle has again what is in force instead of what it has taken."""

            def refuse(result: MavMissionResult | None, *, asked: int, now: float) -> None:  # noqa: ARG001
                words = refusal.text
                if result not in WRITTEN:
                    words += f"; {rover} did not take its earlier fence or rally points back"
                    words += ": upload them again"
                answer(Rejection(TaskReason(refusal.reason), words), now=now)

            in_force = [unpacked(plans.stored(vehicle.system_id, kind).source) for kind in taken]
            self._write(taken, in_force, refuse, now=now)

        self._write(bounds, [items] * len(bounds), written, now=now)

    def _write(
        self, kinds: Sequence[int], items: Sequence[tuple[Item, ...]], done: Written, *, now: float
    ) -> None:
        """Write bounds of these types to the vehicle, in turn, until it does not take one."""
        requests = self._vehicle.requests

        # opaque_id is the vehicle's own id of the plan, which means nothing to clients
        def write_next(
            asked: int,
            result: MavMissionResult | None,
            *,
            opaque_id: int,  # noqa: ARG001
            now: float,
        ) -> None:
            if result not in WRITTEN or asked == len(kinds):
                done(result, asked=asked, now=now)
                return
            after = partial(write_next, asked + 1)
            requests.write_plan(kinds[asked], fence_for_vehicle(items[asked]), after, now=now)

        write_next(0, MavMissionResult.ACCEPTED, opaque_id=0, now=now)


__all__ = ["MissionMessage", "MissionServers"]


class MissionServers:
    """The servers of the mission protocol at all addresses."""

    def __init__(self, parts: MissionParts) -> None:
        self._parts = parts
        self._transfers: dict[tuple[int, Address, int], PlanTransfer] = {}

    def apply(self, settings: Settings) -> None:
        self._parts.settings = settings

    def nonce_taken(self, taken: NonceTaken, *, now: float) -> None:
        """Answer an upload with the task that the fleet had with its nonce."""
        task = self._parts.registry.get(taken.task_id)
        if task is not None and task.command == MavCmd.MISSION_START:
            is_same = taken.payload == task.marks.payload
            answer = taken.known if is_same else reused(task.marks.nonce)
            self._transfer(None, self._parts.vehicles.our_address, MISSION).finish(answer, now=now)

    def forget(self, vehicle: int) -> None:
        """End the transfers of a vehicle's plans: clients begin again at its next gateway."""
        for key in [each for each in self._transfers if each[0] == vehicle]:
            self._parts.timers.forget(self._transfers.pop(key).timer)
        for plan in [each for each in self._parts.storing if each[0] == vehicle]:
            del self._parts.storing[plan]

    def receive(
        self, client: GcsClient, packet: Packet, message: MissionMessage, *, now: float
    ) -> bool:
        """Handle a client's message. Return False if it is not for the server."""
        vehicles, component = self._parts.vehicles, message.target_component
        # most messages leave the vehicle as it is; the others mark it dirty
        vehicle = vehicles.look_at(message.target_system)
        if vehicle is None:
            ours = vehicles.our_address
            address = Address(message.target_system, component or ours.component_id)
            is_ours = address == ours and isinstance(message, UploadMessage)
        else:
            address = Address(vehicle.system_id, component or AUTOPILOT)
            is_claimed = address.component_id == AUTOPILOT and vehicle.parts.settings.claim
            is_ours = is_claimed or address.component_id == vehicle.server_component
        if is_ours:
            kind = getattr(message, "mission_type", MISSION)
            self._transfer(vehicle, address, kind).receive(client, packet, message, now=now)
        return is_ours

    def _transfer(self, vehicle: Vehicle | None, address: Address, kind: int) -> PlanTransfer:
        """Return the transfers of plans of a type; those of an unknown one are not remembered."""
        key = 0 if vehicle is None else vehicle.system_id, address, kind
        transfer = self._transfers.get(key)
        if transfer is None:
            transfer = PlanTransfer(self._parts, vehicle, address, kind)
            if kind in STORED:
                self._transfers[key] = transfer
        return transfer
