"""All vehicles and the links to them: finds vehicles, receives from them, and routes to them.

Any bytes may come in. Only a packet with a good CRC, from a known or newly heartbeating system,
changes anything.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from collections.abc import Set as AbstractSet
from math import inf

from mav_tasks.engine.clients.signatures import Signatures
from mav_tasks.engine.inputs import Outgoing, Peer, Place
from mav_tasks.engine.packet_sender import PacketSender
from mav_tasks.engine.snapshot import Reach
from mav_tasks.engine.timers import Timers
from mav_tasks.engine.vehicles.control import Event
from mav_tasks.engine.vehicles.deadline_heap import DeadlineHeap
from mav_tasks.engine.vehicles.hands import Word
from mav_tasks.engine.vehicles.lease_watch import LeaseWatch
from mav_tasks.engine.vehicles.strangers import MOTION, Beat, Moved, Strangers
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.vehicle_links import VehicleLinks
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.codec import Decoder, Packer
from mav_tasks.mavlink.enums import MavAutopilot, MavType
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.heartbeat import gcs_heartbeat, kind_of
from mav_tasks.services.orders import DRIVEN, Orders
from mav_tasks.services.persona import ARDUPILOT, Persona, persona_of
from mav_tasks.settings import Settings
from mav_tasks.tasks.events import SERVER, VehicleNoted, VehicleSeen
from mav_tasks.tasks.fleet import Fleet
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.vehicle_tasks import VehicleTasks

NANO = 1e9  # TIMESYNC is in ns
ASKED = 64  # TIMESYNC requests, one a second and link, whose answers are still accepted
OLD_NEWS = 0.3  # s after a stall of this process, in which packets may have waited to be read
#: s without a heartbeat, or since it was taken without any, after which another gateway may get a
#: vehicle: longer than a restart of its radio; and s for which a halt is sent to a silent vehicle
GONE = 5.0
#: s in which no task starts on a vehicle that this gateway has got: set-points of another
#: controller, who sends several a second, show that it is there
LISTENS = 1.0
MOST_NOTES = 256
MOST_NAMED = 5  # tasks named in one text
ANOTHER = (
    "is another vehicle now. If its tasks are for this one, press a Held button for each held"
    " one, then Continue"
)
SHARED = "shares its id with another vehicle: none is driven before one is alone. Change one id"
ECHO = (
    "sends the server's own packets back on {}. Look for a router on this link that is in a loop,"
    " or an adapter that hears itself"
)

#: messages that only a controller of the vehicle sends
SETPOINTS = frozenset(
    {m.SetPositionTargetLocalNed.id, m.SetPositionTargetGlobalInt.id, m.SetAttitudeTarget.id}
)
#: what the server itself decodes; everything else is forwarded unread
USED = frozenset(
    {
        m.Heartbeat.id,
        m.Attitude.id,
        m.LocalPositionNed.id,
        m.GlobalPositionInt.id,
        m.GpsGlobalOrigin.id,
        m.HomePosition.id,
        m.AutopilotVersion.id,
        m.CommandAck.id,
        m.MissionAck.id,
        m.MissionCurrent.id,
        m.MissionRequest.id,
        m.MissionRequestInt.id,
        m.ParamValue.id,
        m.RcChannels.id,
        m.Statustext.id,
        m.SysStatus.id,
        m.Timesync.id,
    }
    | SETPOINTS
)
NO_AUTOPILOT = MavAutopilot.INVALID
NOT_VEHICLES = frozenset({MavType.GCS, MavType.ONBOARD_CONTROLLER})


class VehicleSide:
    """The vehicles by system id, and the vehicle links."""

    def __init__(
        self,
        *,
        queue: list[Outgoing],
        packer: Packer,
        signatures: Signatures,
        registry: TaskRegistry,
        fleet: Fleet,
        timers: Timers,
        settings: Settings,
        is_shared: bool,
    ) -> None:
        """``is_shared``: other gateways have vehicles, too; this one serves those of ``take``."""
        self._signatures = signatures
        self._registry = registry
        self._fleet = fleet
        self._settings = settings
        #: the address under which the server speaks to vehicles
        self.our_address = _own_address(settings)
        self._decoder = Decoder()
        #: packet counts of the vehicle links
        self.counts = self._decoder.counts
        #: the deadlines of all vehicles
        self.deadline_heap = DeadlineHeap(timers)
        #: note that a vehicle that was only looked at is about to be changed
        self.mark_dirty = self.deadline_heap.mark_dirty
        self._noted: set[str] = set()
        self._answer: Packet | None = None  # the last answer to our TIMESYNC
        self._asked: deque[int] = deque(maxlen=ASKED)  # time stamps of our TIMESYNC requests, ns
        self._question = m.Timesync(0, 0)  # refilled for each request
        self._vehicles: dict[int, Vehicle] = {}
        #: all vehicles, read-only
        self.all = self._vehicles.values()
        #: all vehicles by system id, read-only
        self.by_id: Mapping[int, Vehicle] = self._vehicles
        #: returns a vehicle, read-only
        self.look_at = self._vehicles.get
        #: what may be sent to them now
        self.lease = LeaseWatch(timers, self._change_of_lease, is_shared=is_shared)
        #: those that it has, and since when; None: all
        self._ours: dict[int, float] | None = {} if is_shared else None
        self._strangers = Strangers()
        #: the ids at which another vehicle answers now; the reader clears it
        self.gone: list[int] = []
        #: the links and endpoints
        self.links = VehicleLinks(
            self._vehicles,
            queue=queue,
            packer=packer,
            signatures=signatures,
            fence=self.lease.fence,
            settings=settings,
            registry=registry,
            timers=timers,
            beat=self._beat,
            note_once=self.note_once,
        )

    def get(self, system_id: int) -> Vehicle | None:
        """Return a vehicle in order to change it."""
        vehicle = self._vehicles.get(system_id)
        if vehicle is not None:
            self.deadline_heap.mark_dirty(vehicle)
        return vehicle

    def addressed_by(self, system_id: int) -> list[Vehicle]:
        """Return the vehicles that a target_system addresses; 0 addresses all of them."""
        if system_id:
            vehicle = self.get(system_id)
            return [] if vehicle is None else [vehicle]
        return [vehicle for vehicle in map(self.get, sorted(self._vehicles)) if vehicle is not None]

    def stop_unheard(self, system_id: int, *, clear: bool, actor: str, now: float) -> list[int]:
        """Latch STOP for vehicles of an earlier run that were not heard yet. Return their ids.

        They are stopped when they are heard. ``system_id`` 0 means all of them.
        """
        unheard = [tasks for tasks in self.unheard if system_id in (0, tasks.vehicle)]
        for tasks in unheard:
            tasks.stop(clear=clear, actor=actor, now=now)
            if beat := self._strangers.take_beat(tasks.vehicle, now=now):
                self._ask_to_hold(beat)
        return [tasks.vehicle for tasks in unheard]

    @property
    def unheard(self) -> list[VehicleTasks]:
        """The tasks of each vehicle of an earlier run that was not heard in this one."""
        return [tasks for tasks in self._fleet if tasks.vehicle not in self._vehicles]

    def has_listened(self, *, now: float) -> bool:
        """Return whether this run is old enough to have heard every vehicle that is there."""
        return now - self._fleet.began_at > self._settings.watch.heartbeat_lost

    def take(self, vehicles: Iterable[int], *, now: float) -> None:
        """Serve these vehicles, which this gateway has got.

        One that was driven is stopped at once if its last heartbeat came just now.
        """
        assert self._ours is not None, "a server without a fleet has all vehicles"
        for vehicle in vehicles:
            self._ours[vehicle] = now
            if beat := self._strangers.take_beat(vehicle, now=now):
                self._meet(beat, now=now)

    def reach(self, *, now: float) -> Reach:
        """Return the vehicles that are heard, those that this gateway has, and can forget."""
        since = now - self._settings.watch.heartbeat_lost
        heard = {each.system_id for each in self.all if each.is_heard(now=now)}
        heard |= self._strangers.heard_since(since)
        ours = self._ours or {}
        strays = {each for each in ours if each not in heard and self.is_stray(each, now=now)}
        return Reach(frozenset(heard), frozenset(ours), frozenset(strays))

    def is_stray(self, system_id: int, *, now: float) -> bool:
        """Return whether a vehicle that this gateway has is silent, idle, and stored as it is.

        Zeros and HOLD are still sent to it, because it has not shown HOLD, if a task was driving
        it: they go on for ever, and keep nobody from it. Its next gateway stops it, too.
        """
        if self._ours is None or system_id not in self._ours:
            return False
        vehicle = self._vehicles.get(system_id)
        heard_at = self._ours[system_id] if vehicle is None else vehicle.heard_at
        if now - heard_at < max(GONE, self._settings.watch.heartbeat_lost):
            return False
        return self._registry.is_all_durable(system_id) and self._fleet.may_forget(
            system_id, halted_before=now - GONE
        )

    def _drop(self, system_id: int) -> bool:
        """Drop all control of a vehicle. Return whether it was driven."""
        vehicle = self._vehicles.pop(system_id, None)
        self.deadline_heap.forget(system_id)
        if vehicle is None:
            return False
        self.links.forget(vehicle)
        return vehicle.shut()

    def forget(self, system_id: int) -> None:
        """Forget a vehicle, which another gateway may have from here on."""
        assert self._ours is not None, "a server without a fleet has all vehicles"
        del self._ours[system_id]
        self._drop(system_id)
        self._noted = {each for each in self._noted if not each.startswith(f"{system_id} ")}
        if self._answer is not None and self._answer.system_id == system_id:
            self._answer = None

    def pause_tasks_of(self, keys: AbstractSet[str], *, now: float) -> None:
        """Pause each vehicle that has a task of a revoked key, even if another key's task drives.

        Only an operator can say whether the requests of that key are still wanted.
        """
        for each in self.all if keys else ():
            each.parts.forget_start_of(keys)
        for tasks in self._fleet if keys else ():
            theirs = [task for task in tasks.unfinished if task.submitter.key in keys]
            if not theirs:
                continue
            names = ", ".join(sorted({task.submitter.key for task in theirs}))
            ids = ", ".join(str(task.id) for task in theirs[:MOST_NAMED])
            more = f" and {len(theirs) - MOST_NAMED} more" if len(theirs) > MOST_NAMED else ""
            words = (
                f"is paused: key {names} is no longer valid."
                f" Cancel its tasks {ids}{more}, or press Continue"
            )
            self._registry.record(VehicleNoted(tasks.vehicle, words, now))
            vehicle = self.get(tasks.vehicle)
            if vehicle is None:
                tasks.pause(TaskReason.OPERATOR, actor=SERVER, now=now)
            else:
                vehicle.joint.on(Event.PAUSE_TASKS, Word(), now=now)

    def shut_down(self, *, now: float) -> None:
        """Stop what we drive: the server ends. In a fleet, other gateways get the vehicles."""
        if self.lease.is_shared:
            self.lease.leave()
        for vehicle in self.addressed_by(0):
            if self.lease.is_shared:
                vehicle.joint.leave(now=now)
            else:
                vehicle.joint.shut_down(now=now)

    def commit(self, *, now: float) -> None:
        """Start the tasks that waited only for events that are durable now."""
        for vehicle in self.deadline_heap.awaiting_commit():
            self.deadline_heap.mark_dirty(vehicle)
            vehicle.joint.step(now)

    def apply(self, settings: Settings) -> None:
        self._settings = settings
        self.our_address = _own_address(settings)
        self.links.apply(settings)
        for vehicle in self.all:
            vehicle.apply(settings)
            self.deadline_heap.mark_dirty(vehicle)  # its deadlines may change

    def receive(self, link: str, peer: Peer, packet: Packet, *, now: float) -> Vehicle | None:
        """Process a packet. Return the vehicle in whose name to forward it, or None.

        The caller must not forward COMMAND_ACK: it goes to the client that sent the command.
        """
        message: m.Message | None = None
        if packet.message_id in USED or packet.source == self.our_address:
            message = self._decoder.decode(packet)
            if message is None:  # a packet that cannot be verified changes nothing
                return None
        elif packet.message_id not in m.ALL:
            self.counts.unknown += 1
        if self._signatures.admit(link, peer, packet) is None:
            return None
        if packet.source == self.our_address or packet.message_id in SETPOINTS:
            if self._ours is not None and isinstance(message, m.Heartbeat | m.Timesync):
                return None  # another gateway's, which listens here, too
            self._note_intruder((link, peer), packet, message, now=now)
            return None
        vehicle = self.get(packet.system_id)
        from_autopilot, beat = packet.component_id == AUTOPILOT, None
        if isinstance(message, m.Heartbeat) and from_autopilot:
            beat = Beat(link, peer, packet, message, now)
        if vehicle is None:
            if isinstance(message, MOTION) and from_autopilot:
                self._strangers.note_motion(packet.system_id, Moved(link, peer, message, now))
            if beat is None:
                return None
            if self._ours is not None and packet.system_id not in self._ours:
                if self._persona_of(beat) is not None:
                    self._strangers.note_beat(beat)  # another gateway's, which this one may get
                return None
            vehicle = self._meet(beat, now=now)
        elif beat and beat.message.autopilot == NO_AUTOPILOT:
            return None  # from a program that uses the rover's address
        else:
            number = vehicle.system_id
            answer = message if isinstance(message, m.Timesync) else None
            if answer is not None and answer.ts1 not in self._asked:
                answer = None
            if answer is not None and answer.tc1 and from_autopilot:
                self.links.way(number, (link, peer), now=now).note_answer(answer, now=now)
            if vehicle.requests.place != (link, peer) and not (
                from_autopilot
                and message is not None
                and self.links.moves(vehicle, link, peer, message, now=now)
            ):
                return None
            if answer is not None:
                self._answer = packet
                if answer.tc1 and from_autopilot:
                    offset = vehicle.where.motion.clock.offset
                    offset.exchange(answer.ts1 / NANO, answer.tc1 / NANO, now=now)
            if from_autopilot and vehicle.shows_another(message, now=now):
                latest = vehicle.parts.monitor.latest
                vehicle = self._succeed(beat or Beat(link, peer, packet, latest, now), now=now)
        if vehicle is None:
            return None
        if from_autopilot:
            vehicle.count(packet.seq, now=now)
        vehicle.requests.intervals.heard(packet.message_id)
        if message is not None:
            if beat:
                if vehicle.is_overtaken(beat.message, now=now):
                    return vehicle  # an old mode or arming state is not news
                vehicle.last_heartbeat = packet
            vehicle.receive(message, packet.component_id, now=now)
        return vehicle

    def is_answer_to_us(self, packet: Packet) -> bool:
        """Return whether this packet answered our TIMESYNC request; a client would misread it."""
        return packet is self._answer

    def check_late(self, *, now: float) -> None:
        """After a delay, and before anything else, stop the vehicles that drove on without us."""
        due = min(
            self.deadline_heap.next_deadline(), *(link.heartbeat.at for link in self.links), inf
        )
        if due + self._settings.watch.late_tick >= now:
            return
        for vehicle in self.all:
            self.deadline_heap.mark_dirty(vehicle)
            vehicle.control.outdated(until=now + OLD_NEWS)
            vehicle.joint.check_late(now=now)

    def _change_of_lease(self, *, now: float) -> None:
        """Stop the vehicles that another gateway may get, or let their tasks go on."""
        for vehicle in self.all:
            self.deadline_heap.mark_dirty(vehicle)
            if self.lease.is_trusted:
                vehicle.joint.wake(now=now)
            else:
                vehicle.joint.on(Event.LEASE_ENDS, Word(), now=now)

    def _beat(self, outlets: Mapping[Peer, PacketSender], *, now: float) -> None:
        """Send a heartbeat and a TIMESYNC request to each endpoint of a link, each second."""
        self._question.ts1 = round(now * NANO)
        self._asked.append(self._question.ts1)
        for outlet in outlets.values():
            is_ours = self.links.has_vehicle_at(outlet.link, outlet.peer)
            outlet.send_unfenced(gcs_heartbeat(), self.our_address, is_ours=is_ours)
            outlet.send_unfenced(self._question, self.our_address, is_ours=is_ours)

    def _succeed(self, beat: Beat, *, now: float) -> Vehicle | None:
        """Meet another vehicle at a known address: nothing of the old one's control survives."""
        number = beat.packet.system_id
        self.links.withdraw(self._vehicles[number])
        if self._drop(number):
            self._ask_to_hold(beat)
        self.gone.append(number)
        self._fleet.of(number).belong_to_another(now=now)
        self._registry.record(VehicleNoted(number, ANOTHER, now))
        return self._meet(beat, now=now)

    def _ask_to_hold(self, beat: Beat) -> None:
        """Ask what is not served, or only just heard, to stay where it is."""
        if way := self.links.meets(beat.link, beat.peer):
            orders = Orders(beat.packet.source, persona_of(beat.message) or ARDUPILOT)
            way[0].send(orders.staying_there(beat.message.type), self.our_address, first=True)

    def _meet(self, beat: Beat, *, now: float) -> Vehicle | None:
        """Add a new vehicle if a first heartbeat is from an autopilot that we can drive."""
        link_name, peer, packet, heartbeat, _ = beat
        number = packet.system_id
        persona, tasks = self._persona_of(beat), self._fleet.get(number)
        if (
            tasks
            and heartbeat.autopilot != NO_AUTOPILOT
            and not self._strangers.is_alone(beat, (kind_of(heartbeat), tasks.uid))
        ):
            self.note_once(number, SHARED, now=now)
            return None
        if persona is None:
            return None
        way = self.links.meets(link_name, peer)
        if way is None:
            return None
        outlet, is_new = way
        if is_new:
            outlet.send_unfenced(gcs_heartbeat(), self.our_address, is_ours=True)
        vehicle = Vehicle(
            number,
            heartbeat=heartbeat,
            persona=persona,
            outlet=outlet,
            registry=self._registry,
            tasks=self._fleet.of(number),
            settings=self._settings,
            lease=self.lease,
            may_arm=self.links.may_arm(link_name),
            now=now,
        )
        if self._ours is not None:
            vehicle.parts.listens_until = now + LISTENS
        self._vehicles[number] = vehicle
        self.links.forget_budgets()
        self.deadline_heap.mark_dirty(vehicle)
        self._registry.record(VehicleSeen(number, f"found ({persona.name})", now))
        for moved in self._strangers.take_motion(number, link_name, peer, now=now):
            vehicle.where.receive(moved.message, now=moved.at, not_after=moved.at)
        was_driven = self._fleet.was_driven(number)
        halt = self._fleet.last_halt(number, now=now)
        vehicle.come_back(was_driven=was_driven, halt=halt, now=now)
        vehicle.joint.step(now)
        return vehicle

    def _persona_of(self, beat: Beat) -> Persona | None:
        """Return the persona of the autopilot that sends a heartbeat; None: it is not driven."""
        _, _, packet, heartbeat, now = beat
        if heartbeat.type in NOT_VEHICLES:
            return None
        if packet.system_id in (0, self.our_address.system_id):
            return None  # 0 addresses every vehicle, and our own id belongs to no vehicle
        if heartbeat.type not in DRIVEN:  # other types give the mode numbers other meanings
            words = f"has vehicle type {heartbeat.type}, not that of a rover: not driven"
            self.note_once(packet.system_id, words, now=now)
            return None
        persona = persona_of(heartbeat, honours_yaw_rate=self._settings.yaw_rate == "honoured")
        if persona is None:
            self.note_once(
                packet.system_id,
                f"has autopilot type {heartbeat.autopilot}, which is not supported: not driven",
                now=now,
            )
        return persona

    def _note_intruder(
        self, place: Place, packet: Packet, message: m.Message | None, *, now: float
    ) -> None:
        """Handle setpoints, or our own address, from the vehicles' side: a second server drives.

        What this server has sent itself drives nothing. A rover passes it from link to link, too.
        """
        target = getattr(message, "target_system", 0)
        sent_to = self.links.where_sent(packet, place)
        for vehicle in self.all:
            there = vehicle.requests.place
            if sent_to == {place} and there == place:
                self.note_once(vehicle.system_id, ECHO.format(place[0]), now=now)
            elif not sent_to and target in (0, vehicle.system_id) and there[0] == place[0]:
                self.deadline_heap.mark_dirty(vehicle)
                vehicle.joint.second_controller(packet.source, now=now)

    def note_once(self, system_id: int, text: str, *, now: float) -> bool:
        """Report a text about a vehicle unless it was reported before; return whether it is new."""
        key = f"{system_id} {text}"
        is_new = key not in self._noted and len(self._noted) < MOST_NOTES
        if is_new:
            self._noted.add(key)
            self._registry.record(VehicleNoted(system_id, text, now))
        return is_new


def _own_address(settings: Settings) -> Address:
    return Address(settings.identity.system_id, settings.identity.component_id)
