"""The whole server as one pure object with five methods. It composes; its parts decide.

``handle`` takes an input and ``handle_deadline`` runs due timers. ``take_events`` returns what the
store must write, ``take_packets`` what the links must send. ``now`` is in monotonic seconds and
never goes back.
"""

from collections.abc import Sequence
from math import inf
from operator import attrgetter
from typing import assert_never

from mav_tasks.config.parameter_table import with_all
from mav_tasks.config.settings import Settings
from mav_tasks.engine import inputs
from mav_tasks.engine.clients.broadcasts import Broadcasts
from mav_tasks.engine.clients.elsewhere import Elsewhere
from mav_tasks.engine.clients.gcs_side import GcsSide, Received
from mav_tasks.engine.clients.message_requests import MessageRequests
from mav_tasks.engine.clients.parameters import ParameterServer, ParamMessage
from mav_tasks.engine.clients.publisher import Publisher
from mav_tasks.engine.clients.refusals import Refusals
from mav_tasks.engine.clients.rights import OPERATOR
from mav_tasks.engine.clients.signatures import Signatures
from mav_tasks.engine.commands.any_rover import AnyRover
from mav_tasks.engine.commands.assignments import Assignments
from mav_tasks.engine.commands.command_request import MessageRequest, kind_of
from mav_tasks.engine.commands.dispatch import Commands
from mav_tasks.engine.commands.forwarding import Forwarder, deliver
from mav_tasks.engine.commands.mode_requests import ModeRequests
from mav_tasks.engine.commands.submissions import Submissions
from mav_tasks.engine.commands.task_control import TaskControl
from mav_tasks.engine.commit_gate import DependencyQuestions
from mav_tasks.engine.figures import Figures
from mav_tasks.engine.inputs import FLEET_LINK, Input, LinkSide, Outgoing, Packets, Peer
from mav_tasks.engine.missions.mission_reports import MissionReports
from mav_tasks.engine.missions.plan_transfer import MissionMessage, MissionServers
from mav_tasks.engine.missions.plans import Plans
from mav_tasks.engine.missions.transfer import MissionParts
from mav_tasks.engine.packets import LeaseWatch, PacketReader
from mav_tasks.engine.policy import Kind
from mav_tasks.engine.snapshot import Reach, Snapshot, VehicleSnapshot
from mav_tasks.engine.timers import Timers, Turn
from mav_tasks.engine.vehicles.shown import REWRITTEN
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import BROADCAST
from mav_tasks.mavlink.codec import Packer
from mav_tasks.mavlink.sequence import RestartWatch
from mav_tasks.tasks.deduplicator import SubmissionDeduplicator
from mav_tasks.tasks.events import Event, ServerStopped, TaskSubmitted
from mav_tasks.tasks.fleet import Fleet
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.restored import Restored


class Engine:
    """The task server without sockets, clock or disk."""

    def __init__(self, settings: Settings, *, now: float, restored: Restored | None = None) -> None:
        earlier = restored or Restored()
        configured, (settings, why_not) = settings, with_all(settings, earlier.parameters)
        #: why the latest settings override parameters that clients set
        self.not_in_force = tuple(why for _, why in sorted(why_not.items()))
        self._settings = settings
        self._packets: list[Outgoing] = []
        self._intake = PacketReader()
        self._journal: list[Event] = []
        registry = self._registry = TaskRegistry()
        self._fleet = Fleet(registry, settings)
        if restored is not None:
            self._fleet.restore(restored, now=now)
        packer, timers = Packer(), Timers()
        self._timers = timers
        self._keeping = timers.timer(Turn.SETTLING, self._settle)  # stores the times of signatures
        self._stopping = timers.timer(Turn.SETTLING, self._settle)
        self._starting = timers.timer(Turn.TASKS, self._fleet.room.handle_deadline)
        self._starting.set(self._fleet.room.times.next_at)
        self._telling = timers.timer(Turn.STATUSES, self._tell_statuses)
        #: verifies the signatures of incoming packets and signs outgoing ones
        self.signatures = Signatures(
            window=settings.signing.window,
            times=earlier.signatures,
            signed_until=earlier.signed_until,
        )
        gcs = self._gcs = GcsSide(
            queue=self._packets,
            packer=packer,
            signatures=self.signatures,
            statuses=self._telling,
            settings=settings,
        )
        vehicles = self._vehicles = VehicleSide(
            self._packets,
            packer,
            self.signatures,
            registry,
            self._fleet,
            timers,
            settings,
            LeaseWatch(timers, is_shared=bool(earlier.gateway)),
        )
        deduplicator = self._deduplicator = SubmissionDeduplicator(registry)
        deduplicator.restore(earlier.tasks, now=now)
        questions = self._questions = DependencyQuestions(self._fleet.room, timers)
        self._expected: frozenset[int] = frozenset()
        submissions = Submissions(gcs, registry, deduplicator, questions, timers, settings)
        self._submissions = submissions
        self._parameters = ParameterServer(
            gcs, vehicles, registry, submissions, settings=configured, kept=earlier.parameters
        )
        plans = self._plans = Plans(registry, self._fleet, restored=earlier.plans)
        displays = MessageRequests(gcs, vehicles, self.signatures, registry, earlier.gateway)
        self._displays = displays
        refusals = self._refusals = Refusals(registry, vehicles)
        modes = self._modes = ModeRequests(gcs, submissions, plans, refusals)
        control = self._control = TaskControl(registry)
        assignments = self._assignments = Assignments(
            vehicles, self._fleet, registry, timers, settings, is_open=lambda: submissions.is_open
        )
        assignments.watch(earlier.tasks, now=now)
        room = self._fleet.room
        elsewhere = self._elsewhere = Elsewhere(self._packets, gcs, vehicles)
        self._any = AnyRover(
            vehicles, registry, room, submissions, assignments, displays, elsewhere, settings
        )
        parts = MissionParts(
            gcs, vehicles, registry, submissions, assignments, plans, timers, settings
        )
        self._desks, self._reports = MissionServers(parts), MissionReports(parts, now=now)
        self._publisher = Publisher(
            gcs, vehicles, registry, displays, submissions, timers, settings, now=now
        )
        self._passing = Forwarder(vehicles, refusals)
        self._broadcasts = Broadcasts(vehicles, packer)
        self._commands = Commands(vehicles, submissions, plans, modes, control, displays, self._any)
        self._restarts = RestartWatch()
        #: figures for metrics
        self.figures = Figures(vehicles, gcs, self._fleet, registry)
        self._stop_by = inf  # by then, vehicles have stopped, or the server ends without
        self._stopped = False
        #: zero and HOLD for every driven vehicle, as of the last ``take_packets``; the runner sends
        #: them if the engine raises
        self.emergency_stop_packets: tuple[Outgoing, ...] = ()

    def __repr__(self) -> str:
        return f"Engine({list(self._vehicles.all)}, {list(self._gcs.clients)}, {self._registry!r})"

    @property
    def parameters(self) -> dict[str, float]:
        """Parameter values that clients have set, by name; they override the configuration."""
        return self._parameters.in_force

    def handle(self, item: Input, *, now: float) -> None:
        """Process one input."""
        self.signatures.now = now
        if self._timers.not_before + self._settings.watch.late_tick < now:
            self._vehicles.check_late(now=now)
        match item:
            case inputs.Packets():
                self._receive((item,), now=now)
            case inputs.Committed(through=through):
                self._submissions.store_is_away = False
                self._registry.durable = through
                self._submissions.gate.look(now=now)
                self._vehicles.commit(now=now)
            case inputs.HaltsKept(through=through):
                self._submissions.gate.halts_kept = through
                self._submissions.gate.look(now=now)
            case inputs.AtOnce(packets=several):
                self._receive(several, now=now)
            case inputs.LinkChanged(side=side):
                self._intake.change_link(item)
                self.signatures.change_link(item)
                clients = side is LinkSide.CLIENTS
                (self._gcs if clients else self._vehicles).change_link(item, now=now)
            case inputs.KeysChanged():
                gone = self.signatures.change_keys(item)
                self._questions.keys_revoked(now=now)
                self._vehicles.pause_tasks_of(gone, now=now)
                for link, peer in self._gcs.forget_unknown():
                    self._passing.end(link, peer, now=now)
            case inputs.PeerChanged():
                self._intake.change_peer(item)
                self._gcs.change_peer(item, now=now)
                self._vehicles.change_peer(item)
                if item.link in self._gcs.links:
                    self._passing.end(item.link, item.peer, now=now)
            case inputs.Congestion():
                self._gcs.note_congestion(item, now=now)
            case inputs.StoreFailed():
                if not self._submissions.store_is_away:
                    self._submissions.store_is_away = True
                    self._publisher.warn_of_store(now=now)
            case inputs.HaltNotStored():
                pass  # for the metrics; the answer to the halt has said so
            case inputs.LeaseChanged():
                self._vehicles.lease.change(item, now=now)
            case inputs.VehiclesTaken(vehicles=vehicles, restored=restored):
                self._take_over(vehicles, restored, now=now)
            case inputs.VehiclesGone(vehicles=vehicles):
                self._let_go(vehicles, now=now)
            case inputs.FleetChanged():
                self._elsewhere.change(item, now=now)
            case inputs.TasksElsewhere(states=states):
                with self._fleet.room.told(dict(states), now=now):
                    self._questions.answered(now=now)
            case inputs.ParametersChanged(values=values):
                self._parameters.share(dict(values))
                self.not_in_force = self._parameters.not_in_force
            case inputs.IdsGranted(first=first, count=count):
                self._registry.ids.grant(first, count)
            case inputs.NonceTaken():
                self._desks.nonce_taken(item, now=now)
                self._any.nonce_taken(item, now=now)
            case inputs.SettingsChanged(settings=settings):
                self._apply(self._parameters.configured(settings), now=now)
                self.not_in_force = self._parameters.not_in_force
            case inputs.WallClock(offset=offset):
                self.signatures.set_wall(offset)
                self._fleet.room.set_wall_offset(offset, now=now)
            case inputs.Shutdown():
                self._submissions.close()
                self._stop_by = now + self._settings.watch.shutdown
                self._stopping.set(self._stop_by)
                self._vehicles.shut_down(now=now)
            case _:
                assert_never(item)
        self._settle(now=now)

    def next_deadline(self) -> float | None:
        """Return when ``handle_deadline`` must be called next, or None if no timer is set."""
        if self._vehicles.touched:  # by ``_settle``, after it settled them
            self._vehicles.plan()
        due = self._timers.next_deadline()
        return None if due == inf else due

    def handle_deadline(self, *, now: float) -> None:
        """Do everything due by ``now``; the call may be late, or needless."""
        self.signatures.now = now
        if self._timers.not_before + self._settings.watch.late_tick < now:
            self._vehicles.check_late(now=now)
        due = self._timers.take_due(now=now)
        for timer in due:
            if timer.turn < Turn.SETTLING:
                timer.do(now=now)
        self._settle(now=now)
        for timer in due:
            if timer.turn > Turn.SETTLING:
                timer.do(now=now)

    def take_events(self) -> list[Event]:
        """Return the events since the last call, to be made durable in this order.

        They are numbered from 1 over the life of the engine; ``Committed`` has such a number.
        """
        events, self._journal = self._journal, []
        return events

    def take_packets(self) -> list[Outgoing]:
        """Return the datagrams to send, in order."""
        self.emergency_stop_packets = self._vehicles.emergency_stop_packets
        packets = self._packets.copy()
        self._packets.clear()  # clear in place: every PacketSender shares this list
        return packets

    def snapshot(self, *, now: float) -> Snapshot:
        """Return an immutable view of the whole server."""
        return Snapshot(
            vehicles=tuple(
                VehicleSnapshot(
                    system_id=vehicle.system_id,
                    persona=vehicle.persona.name,
                    armed=vehicle.armed,
                    heard=vehicle.is_heard(now=now),
                    control=vehicle.control.phase.name,
                    paused=vehicle.tasks.paused,
                    active=vehicle.tasks.active,
                    waiting=tuple(vehicle.tasks.waiting),
                )
                for vehicle in self._vehicles.all
            ),
            clients=tuple(repr(client) for client in self._gcs.clients),
            tasks=self._registry.all(),
            decoded=(
                f"vehicles {self._vehicles.counts}, clients {self._gcs.counts},"
                f" {self.signatures.counts}, dropped {self._gcs.left_out} datagrams,"
                f" {self._refusals.left_out} requests"
            ),
        )

    def has_heard(self, link: str, peer: Peer) -> bool:
        """Return whether a client or a rover at an endpoint has sent a valid packet."""
        if client := self._gcs.client((link, peer)):
            return client.is_heard
        return self._vehicles.has_vehicle_at(link, peer)

    def reach(self, *, now: float) -> Reach:
        """Return which vehicles are heard, also those that another gateway has, and are ours."""
        reach = self._vehicles.reach(now=now)
        is_busy = self._submissions.gate or self._questions.held
        return reach._replace(strays=frozenset()) if is_busy else reach

    @property
    def expected(self) -> frozenset[int]:
        """Return the tasks of others of which ``TasksElsewhere`` must tell how they stand.

        It is another object after each change: then it must tell that of all of them again.
        """
        return self._expected

    @property
    def stop_until(self) -> float:
        """Until when ``emergency_stop_packets`` may leave, s."""
        return self._vehicles.lease.stop_until

    def _receive(self, items: Sequence[Packets], *, now: float) -> None:
        """Handle packets in the order of their arrival; those that halt a rover come first."""
        received: list[Received] = []
        others: list[Packets] = []
        for item in items:
            if item.link in self._gcs.links:
                if item.link == FLEET_LINK:
                    item = self._elsewhere.bring_back(item)
                taken = self._gcs.let_in(item, now=now)
                for peer, packet, arrived in self._intake.packets(taken, self._gcs.counts, now=now):
                    each = self._gcs.receive(item.link, peer, packet, arrived=arrived, now=now)
                    if each is not None:
                        received.append(each)
            else:
                others.append(item)
        if len(items) > 1:
            received.sort(key=attrgetter("arrived"))
        if len(received) > 1:
            for each in self._halts_first(received):
                self._gcs.hear_out(each, now=now)
                self._receive_from_client(each, now=now)
        elif received:
            self._receive_from_client(received[0], now=now)
        for item in others:
            if item.link in self._vehicles.links:
                self._receive_from_vehicles(item, now=now)

    def _receive_from_vehicles(self, item: Packets, *, now: float) -> None:
        for peer, packet, _ in self._intake.packets(item, self._vehicles.counts, now=now):
            vehicle = self._vehicles.receive(item.link, peer, packet, now=now)
            while self._vehicles.gone:
                self._forget(self._vehicles.gone.pop())
            if vehicle is not None:
                if self._restarts.begins_anew(packet, now=now):
                    self._gcs.continue_numbers(packet)
                if (
                    packet is self._vehicles.answer
                    or packet.message_id == m.CommandAck.id
                    or self._reports.replaces(packet)
                ):
                    self._publisher.withhold(packet)
                else:
                    if packet.message_id in REWRITTEN:
                        is_stopped = vehicle.tasks.is_stopped
                        packet = vehicle.shown.applied(packet, is_stopped=is_stopped, now=now)
                    self._gcs.forward(packet, now=now)

    def _halts_first(self, received: list[Received]) -> list[Received]:
        """Move packets that start or drive a rover behind those that halt one.

        The order is otherwise kept.
        """
        rows = [each.row.kind for each in received]
        if Kind.HALT not in rows and Kind.GO not in rows:  # HOLD has the row of all modes
            return received
        kinds = [self._kind_of(each) for each in received]
        if Kind.HALT not in kinds:
            return received
        goes = [kind in (Kind.GO, Kind.MOTION) for kind in kinds]
        return [received[number] for number in sorted(range(len(goes)), key=goes.__getitem__)]

    def _kind_of(self, received: Received) -> Kind:
        message, command = received.message, received.command
        target = getattr(message, "target_system", 0)
        is_of_all = target in (BROADCAST, self._vehicles.our_address.system_id)
        vehicle = (
            next(iter(self._vehicles.all), None) if is_of_all else self._vehicles.look_at(target)
        )
        if vehicle is None:
            return Kind.WISH
        if command is not None:
            return kind_of(command, received.row, vehicle)
        if isinstance(message, m.SetMode):
            is_hold = message.custom_mode == vehicle.persona.hold_mode
            return Kind.HALT if is_hold else Kind.GO
        return Kind.WISH if message is None else received.row.kind

    def _forget(self, vehicle: int) -> None:
        """Forget a vehicle, which another gateway, or another vehicle, has the id of from now."""
        self._desks.forget(vehicle)
        self._reports.forget(vehicle)
        self._restarts.forget(vehicle)

    def _receive_from_client(self, received: Received, *, now: float) -> None:
        if not self._refusals.may_pass(received, now=now):
            return
        if self._elsewhere.is_shared and self._elsewhere.takes(received, now=now):
            return
        if len(received.client.introduced) < len(self._vehicles.by_id):
            self._publisher.welcome(received.client, now=now)
        if getattr(received.message, "target_system", None) == BROADCAST:
            for each in self._broadcasts.addressed(received):
                self._see_to(each, now=now)
        else:
            self._see_to(received, now=now)

    def _see_to(self, received: Received, *, now: float) -> None:
        client, packet, message = received.client, received.packet, received.message
        if received.command is not None:
            self._commands.receive(received, received.command, now=now)
            return
        match message:
            case m.CommandCancel():
                if vehicle := self._vehicles.get(message.target_system):
                    source, command = packet.source, message.command
                    self._control.cancel_latest(client, vehicle, source, command, now=now)
            case m.SetMode():
                if vehicle := self._vehicles.get(message.target_system):
                    mode = int(message.custom_mode)
                    asked = MessageRequest.of(client, vehicle, packet, mode, now=now)
                    self._modes.heard(asked, now=now)
            case m.RequestDataStream():
                self._displays.set_streams(client, message)
            case m.SetupSigning():
                self._displays.set_up_signing(client, message, now=now)
            case m.Heartbeat() if packet.system_id in self._vehicles.by_id:
                pass  # of a rover's component: back by another link, it would be on its side
            case _:
                if isinstance(message, MissionMessage) and self._desks.receive(
                    client, packet, message, now=now
                ):
                    return
                if isinstance(message, m.Heartbeat) and client.rights.reach(OPERATOR):
                    self._publisher.hear_operator(message, now=now)
                elif isinstance(message, ParamMessage):
                    self._parameters.receive(client, packet, message, now=now)
                self._passing.forward(received, now=now)

    def _take_over(self, vehicles: Sequence[int], restored: Restored, *, now: float) -> None:
        """Serve vehicles that this gateway has got, with their tasks and plans.

        Obey the STOPs that came before, and that nobody has obeyed.
        """
        self._fleet.take_over(restored, now=now)
        self._deduplicator.restore(restored.tasks, now=now)
        self._assignments.watch(restored.tasks, now=now)
        self._plans.restore(restored.plans)
        self.signatures.take_lead(restored.signing_lead)
        self._vehicles.take(vehicles, now=now)
        for vehicle in vehicles:
            for received in self._elsewhere.stops_for(vehicle, now=now):
                self._gcs.hear_out(received, now=now)
                self._see_to(received, now=now)

    def _let_go(self, vehicles: Sequence[int], *, now: float) -> None:
        """Forget vehicles that another gateway hears, unless something came between."""
        for vehicle in sorted(self.reach(now=now).strays.intersection(vehicles)):
            self._vehicles.forget(vehicle)
            tasks = self._fleet.forget(vehicle, now=now)
            self._deduplicator.forget_vehicle(vehicle, tasks)
            self._assignments.forget(vehicle, tasks)
            self._plans.forget(vehicle)
            self._forget(vehicle)
            self._gcs.forget_vehicle(vehicle, tasks)

    def _tell_statuses(self, *, now: float) -> None:
        self._publisher.send_statuses(now=now)

    def _settle(self, *, now: float) -> None:
        """Pass the vehicles' answers to clients, and new events to clients and the journal."""
        room, signatures = self._fleet.room, self.signatures
        if self._parameters.is_changed:
            self._parameters.is_changed = False
            self._apply(self._parameters.settings, now=now)
        woken_ids, room.woken = room.woken, set()
        for system_id in woken_ids:
            if woken := self._vehicles.get(system_id):
                woken.joint.wake(now=now)
        for vehicle in self._vehicles.settle() if self._vehicles.touched else ():
            if vehicle.parts.start.given is not None:
                self._modes.look_for_arming(vehicle, now=now)
            answers, unperformed = vehicle.requests.answers, vehicle.requests.unperformed
            while answers:
                deliver(self._gcs, self._submissions, vehicle, answers.pop(0), now=now)
            if unperformed:
                self._reports.tell_unperformed(vehicle, now=now)
            if vehicle.requests.acted:
                self._reports.tell_acted(vehicle, now=now)
        if self._stop_by < inf:
            self._note_stopped(now=now)
        while signatures.refused:
            self._registry.record(signatures.refused.pop(0))
        if signatures.keep_at <= now or signatures.is_used_up:
            self._registry.record(signatures.take_times())
        if self._registry.unplanned:
            room.plan_runs(now=now)
        if self._expected or room.expected or self._questions.held:
            expected = room.expected | self._questions.expected
            if expected != self._expected:
                self._expected = frozenset(expected)
        if self._registry.events:
            events = self._registry.take_events()
            self._publisher.publish(events, now=now)
            self._reports.publish(events, now=now)
            self._journal += events
            for event in events:  # the later runs of a series are made by the server
                if isinstance(event, TaskSubmitted) and event.task.choice:
                    self._assignments.watch((event.task,), now=now)
        if self._telling.at <= now:
            self._publisher.send_statuses(now=now)
        if (due := room.times.next_at) != self._starting.at:
            self._starting.set(due)
        if signatures.keep_at != self._keeping.at:
            self._keeping.set(signatures.keep_at)

    def _apply(self, settings: Settings, *, now: float) -> None:
        self._settings = settings
        self.signatures.apply(settings.signing.window)
        for apply in (
            *(self._fleet.apply, self._gcs.apply, self._vehicles.apply, self._submissions.apply),
            *(self._assignments.apply, self._any.apply, self._desks.apply, self._reports.apply),
            self._publisher.apply,
        ):
            apply(settings)
        for client in self._gcs.clients:
            for vehicle in () if client.rights.may_drive else self._vehicles.all:
                vehicle.joint.end_driving_of(client.key, now=now)

    def _note_stopped(self, *, now: float) -> None:
        rolling = tuple(v.system_id for v in self._vehicles.all if v.control.is_engaged)
        if not self._stopped and (not rolling or now >= self._stop_by):
            self._stopped = True
            self._stopping.set(inf)
            for vehicle in self._vehicles.all:
                vehicle.joint.note_rest(now=now)
            self._registry.record(ServerStopped(rolling, now))
