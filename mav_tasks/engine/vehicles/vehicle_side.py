"""All vehicles and the links to them: finds vehicles, receives from them, and routes to them.

Any bytes may come in. Only a packet with a good CRC, from a known or newly heartbeating system,
changes anything.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from collections.abc import Set as AbstractSet
from functools import partial
from math import inf

from mav_tasks.config.settings import Settings
from mav_tasks.engine.inputs import Outgoing, Peer, Place
from mav_tasks.engine.services.orders import DRIVEN, Orders
from mav_tasks.engine.services.persona import ARDUPILOT, Persona, persona_of
from mav_tasks.engine.services.vehicle_status import gcs_heartbeat, kind_of
from mav_tasks.engine.snapshot import Reach
from mav_tasks.engine.timers import Timer, Turn
from mav_tasks.engine.vehicles.control import Event
from mav_tasks.engine.vehicles.joint_control import Word
from mav_tasks.engine.vehicles.system_ids import MOTION, NANO, Beat, Moved, Strangers
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.vehicle_links import VehicleLinks
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT
from mav_tasks.mavlink.codec import Decoder
from mav_tasks.mavlink.enums import MavAutopilot, MavType
from mav_tasks.mavlink.packet import Packet
from mav_tasks.tasks.events import SERVER, VehicleNoted, VehicleSeen
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.vehicle_tasks import VehicleTasks

OLD_NEWS = 0.3  # s after a stall of this process, in which packets may have waited to be read
#: s without a heartbeat, or since it was taken without any, after which another gateway may get a
#: vehicle: longer than a restart of its radio; and s for which a halt is sent to a silent vehicle
GONE = 5.0
#: s in which no task starts on a vehicle that this gateway has got: set-points of another
#: controller, who sends several a second, show that it is there
LISTENS = 1.0
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
    kind.id
    for kind in (m.SetPositionTargetLocalNed, m.SetPositionTargetGlobalInt, m.SetAttitudeTarget)
)
#: what the server itself decodes; everything else is forwarded unread
USED = SETPOINTS.union(
    kind.id
    for kind in (
        *(m.Heartbeat, m.Attitude, m.LocalPositionNed, m.GlobalPositionInt, m.GpsGlobalOrigin),
        *(m.HomePosition, m.AutopilotVersion, m.CommandAck, m.MissionAck, m.MissionCurrent),
        *(m.MissionRequest, m.MissionRequestInt, m.ParamValue, m.RcChannels, m.Statustext),
        *(m.SysStatus, m.Timesync),
    )
)
NO_AUTOPILOT = MavAutopilot.INVALID
NOT_VEHICLES = frozenset({MavType.GCS, MavType.ONBOARD_CONTROLLER})


class VehicleSide(VehicleLinks):
    """The vehicles by system id, and when each has something to do.

    Only the deadlines of changed vehicles are planned again, so that an input costs the same with
    two rovers as with two hundred.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        self.lease.on_change = self._change_of_lease
        self._decoder = Decoder()
        #: packet counts of the vehicle links
        self.counts = self._decoder.counts
        #: the last answer to our TIMESYNC, which a client would misread
        self.answer: Packet | None = None
        #: all vehicles by system id, read-only
        self.by_id: Mapping[int, Vehicle] = self._vehicles
        #: returns a vehicle, read-only
        self.look_at = self._vehicles.get
        self._ours: dict[int, float] = {}  # those that this gateway of a fleet has, and since when
        self._strangers = Strangers()
        #: the ids at which another vehicle answers now; the reader clears it
        self.gone: list[int] = []
        #: vehicles that may have changed since they were settled
        self.touched: dict[int, Vehicle] = {}
        self._due: dict[int, Timer] = {}
        self._awaiting: dict[int, Vehicle] = {}  # those whose next task waits for the store only
        self._last_words: dict[int, tuple[Outgoing, ...]] = defaultdict(tuple)
        #: zero and HOLD for every vehicle that is being driven
        self.emergency_stop_packets: tuple[Outgoing, ...] = ()

    def mark_dirty(self, vehicle: Vehicle) -> None:
        """Note that a vehicle that was only looked at is about to be changed."""
        self.touched[vehicle.system_id] = vehicle

    def plan(self) -> None:
        """Set the timers of the changed vehicles."""
        for system_id, vehicle in self.touched.items():
            timer, at = self._due.get(system_id), vehicle.next_deadline()
            if timer is not None and timer.at != at:
                timer.set(at)

    def settle(self) -> list[Vehicle]:
        """Plan the changed vehicles, update what is kept of them, and return them."""
        self.plan()
        touched, registry = list(self.touched.values()), self._registry
        self.touched.clear()
        for vehicle in touched:
            system_id, tasks = vehicle.system_id, vehicle.tasks
            first = None  # what may start once it is durable
            if registry.durable < registry.recorded and tasks.executor.task_id is None:
                first = tasks.next_id
            if first is None or registry.is_durable(first):
                self._awaiting.pop(system_id, None)
            else:
                self._awaiting[system_id] = vehicle
            words = vehicle.requests.emergency_stop_packets if vehicle.is_driven else ()
            if words != self._last_words[system_id]:
                self._note_last_words(system_id, words)
        return touched

    def get(self, system_id: int) -> Vehicle | None:
        """Return a vehicle in order to change it."""
        vehicle = self._vehicles.get(system_id)
        if vehicle is not None:
            self.touched[system_id] = vehicle
        return vehicle

    def addressed_by(self, system_id: int) -> list[Vehicle]:
        """Return the vehicles that a target_system addresses; 0 addresses all of them."""
        numbers = (system_id,) if system_id else sorted(self._vehicles)
        return [vehicle for vehicle in map(self.get, numbers) if vehicle is not None]

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

    def why_unheard(self, system_id: int, *, now: float) -> str:
        """Return why a vehicle that has tasks is not served."""
        if self._strangers.share(system_id, now=now):
            return f"rover {system_id} {SHARED}"
        return f"no heartbeat from rover {system_id} yet"

    def has_listened(self, *, now: float) -> bool:
        """Return whether this run is old enough to have heard every vehicle that is there."""
        return now - self._fleet.began_at > self._settings.watch.heartbeat_lost

    def take(self, vehicles: Iterable[int], *, now: float) -> None:
        """Serve these vehicles, which this gateway has got.

        One that was driven is stopped at once if its last heartbeat came just now.
        """
        for vehicle in vehicles:
            self._ours[vehicle] = now
            if beat := self._strangers.take_beat(vehicle, now=now):
                self._meet(beat, now=now)

    def reach(self, *, now: float) -> Reach:
        """Return the vehicles that are heard, those that this gateway has, and can forget."""
        since = now - self._settings.watch.heartbeat_lost
        heard = {each.system_id for each in self.all if each.is_heard(now=now)}
        heard |= {number for number, beat in self._strangers.beats.items() if beat.at >= since}
        silent = self._ours.keys() - heard
        strays = frozenset(each for each in silent if self._is_stray(each, now=now))
        return Reach(frozenset(heard), frozenset(self._ours), strays)

    def _is_stray(self, system_id: int, *, now: float) -> bool:
        """Return whether a vehicle that this gateway has is silent, idle, and stored as it is.

        Zeros and HOLD are still sent to it, because it has not shown HOLD, if a task was driving
        it: they go on for ever, and keep nobody from it. Its next gateway stops it, too.
        """
        vehicle = self._vehicles.get(system_id)
        heard_at = self._ours[system_id] if vehicle is None else vehicle.heard_at
        if now - heard_at < max(GONE, self._settings.watch.heartbeat_lost):
            return False
        is_stored = self._registry.last_event_of(system_id) <= self._registry.durable
        return is_stored and self._fleet.may_forget(system_id, halted_before=now - GONE)

    def _drop(self, system_id: int) -> bool:
        """Drop all control of a vehicle. Return whether it was driven."""
        vehicle = self._vehicles.pop(system_id, None)
        if vehicle is None:
            return False
        self.touched.pop(system_id, None)
        self._awaiting.pop(system_id, None)
        self._timers.forget(self._due.pop(system_id))
        self._note_last_words(system_id, ())
        self._leave(vehicle)
        return vehicle.shut()

    def forget(self, system_id: int) -> None:
        """Forget a vehicle, which another gateway may have from here on."""
        del self._ours[system_id]
        self._drop(system_id)
        self._noted = {each for each in self._noted if each[0] != system_id}

    def pause_tasks_of(self, keys: AbstractSet[str], *, now: float) -> None:
        """Pause each vehicle that has a task of a revoked key, even if another key's task drives.

        Only an operator can say whether the requests of that key are still wanted.
        """
        for each in self.all if keys else ():
            each.parts.forget_start_of(keys, now=now)
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
            self.lease.leave(now=now)
        for vehicle in self.addressed_by(0):
            joint = vehicle.joint
            (joint.leave if self.lease.is_shared else joint.shut_down)(now=now)

    def commit(self, *, now: float) -> None:
        """Start the tasks that waited only for events that are durable now."""
        for vehicle in list(self._awaiting.values()):
            self.mark_dirty(vehicle)
            vehicle.joint.step(now)

    def apply(self, settings: Settings) -> None:
        super().apply(settings)
        for vehicle in self.all:
            vehicle.apply(settings)
            self.mark_dirty(vehicle)  # its deadlines may change

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
        place, (number, component) = (link, peer), packet.source
        if packet.source == self.our_address or packet.message_id in SETPOINTS:
            if self.lease.is_shared and isinstance(message, m.Heartbeat | m.Timesync):
                return None  # another gateway's, which listens here, too
            self._note_intruder(place, packet, message, now=now)
            return None
        vehicle = self._vehicles.get(number)
        from_autopilot, beat = component == AUTOPILOT, None
        if isinstance(message, m.Heartbeat) and from_autopilot:
            beat = Beat(place, packet, message, now)
        if vehicle is None:
            if isinstance(message, MOTION) and from_autopilot:
                self._strangers.moved[number, message.id] = Moved(place, message, now)
            if beat is None:
                return None
            if self.lease.is_shared and number not in self._ours:
                if self._persona_of(beat) is not None:
                    self._strangers.beats[number] = beat  # another gateway's, which it may get
                return None
            vehicle = self._meet(beat, now=now)
        elif beat and beat.message.autopilot == NO_AUTOPILOT:
            return None  # from a program that uses the rover's address
        else:
            answer = told = None  # an answer to us; one that shows the autopilot's clock
            if isinstance(message, m.Timesync) and message.ts1 in self._asked:
                answer, told = packet, message if message.tc1 and from_autopilot else None
            if told is not None:
                self._way(number, place, now=now).note_answer(told, now=now)
            if vehicle.requests.place != place and not (
                from_autopilot
                and message is not None
                and self._moves(vehicle, place, message, now=now)
            ):
                return None
            self.answer = answer or self.answer
            if told is not None:
                clock = vehicle.where.clock
                clock.exchange(told.ts1 / NANO, told.tc1 / NANO, now=now)
            tells = from_autopilot and isinstance(message, m.Heartbeat | m.AutopilotVersion)
            if tells and vehicle.shows_another(message, now=now):
                latest = vehicle.parts.monitor.latest
                vehicle = self._succeed(beat or Beat(place, packet, latest, now), now=now)
        if vehicle is None:
            return None
        if from_autopilot:
            vehicle.count(packet.seq, now=now)
        vehicle.requests.intervals.heard(packet.message_id)
        if message is not None:  # what is not read changes nothing
            self.touched[number] = vehicle
            if beat:
                if vehicle.is_overtaken(beat.message, now=now):
                    return vehicle  # an old mode or arming state is not news
                vehicle.last_heartbeat = packet
            vehicle.receive(message, component, now=now)
        return vehicle

    def check_late(self, *, now: float) -> None:
        """After a delay, and before anything else, stop the vehicles that drove on without us."""
        timers = *self._due.values(), *(link.heartbeat for link in self.links.values())
        due = min((timer.at for timer in timers), default=inf)
        if due + self._settings.watch.late_tick >= now:
            return
        for vehicle in self.all:
            self.mark_dirty(vehicle)
            vehicle.control.outdated(until=now + OLD_NEWS)
            vehicle.joint.check_late(now=now)

    def _change_of_lease(self, *, now: float) -> None:
        """Stop the vehicles that another gateway may get, or let their tasks go on."""
        for vehicle in self.all:
            self.mark_dirty(vehicle)
            if self.lease.is_trusted:
                vehicle.joint.wake(now=now)
            else:
                vehicle.joint.on(Event.LEASE_ENDS, Word(), now=now)

    def _handle_deadline(self, vehicle: Vehicle, *, now: float) -> None:
        self.mark_dirty(vehicle)
        vehicle.handle_deadline(now=now)

    def _note_last_words(self, system_id: int, words: tuple[Outgoing, ...]) -> None:
        """Note the packets that stop a vehicle if the engine fails."""
        self._last_words[system_id] = words
        self.emergency_stop_packets = sum(self._last_words.values(), ())

    def _succeed(self, beat: Beat, *, now: float) -> Vehicle | None:
        """Meet another vehicle at a known address: nothing of the old one's control survives.

        What waits to leave for the old one is dropped, except HOLD.
        """
        number = beat.packet.system_id
        old = self._vehicles[number].requests.place
        self._queue[:] = [e for e in self._queue if e.is_first or (e.link, e.peer) != old]
        if self._drop(number):
            self._ask_to_hold(beat)
        self.gone.append(number)
        self._fleet.of(number).belong_to_another(now=now)
        self._registry.record(VehicleNoted(number, ANOTHER, now))
        return self._meet(beat, now=now)

    def _ask_to_hold(self, beat: Beat) -> None:
        """Ask what is not served, or only just heard, to stay where it is."""
        if outlet := self._meets(beat.place):
            orders = Orders(beat.packet.source, persona_of(beat.message) or ARDUPILOT)
            outlet.send(orders.staying_there(beat.message.type), self.our_address, first=True)

    def _meet(self, beat: Beat, *, now: float) -> Vehicle | None:
        """Add a new vehicle if a first heartbeat is from an autopilot that we can drive."""
        place, packet, heartbeat, _ = beat
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
        is_new, outlet = self._is_gone(place), self._meets(place)
        if outlet is None:
            return None
        if is_new:
            outlet.send(gcs_heartbeat(), self.our_address, is_fenced=False)
        vehicle = Vehicle(
            number,
            heartbeat=heartbeat,
            persona=persona,
            outlet=outlet,
            registry=self._registry,
            tasks=self._fleet.of(number),
            settings=self._settings,
            lease=self.lease,
            may_arm=self._may_arm(place[0]),
            now=now,
        )
        if self.lease.is_shared:
            vehicle.parts.listens_until = now + LISTENS
        self._vehicles[number] = vehicle
        do = partial(self._handle_deadline, vehicle)
        self._due[number] = self._timers.timer(Turn.VEHICLES, do, number=number)
        self._budgets.clear()
        self.mark_dirty(vehicle)
        self._registry.record(VehicleSeen(number, f"found ({persona.name})", now))
        for moved in self._strangers.take_motion(number, place, now=now):
            vehicle.where.receive(moved.message, now=moved.at, not_after=moved.at)
        vehicle.come_back(
            was_driven=self._fleet.was_driven(number),
            halt=self._fleet.last_halt(number, now=now),
            now=now,
        )
        vehicle.joint.step(now)
        return vehicle

    def _persona_of(self, beat: Beat) -> Persona | None:
        """Return the persona of the autopilot that sends a heartbeat; None: it is not driven."""
        heartbeat, number = beat.message, beat.packet.system_id
        # 0 addresses every vehicle, and our own id belongs to no vehicle
        if heartbeat.type in NOT_VEHICLES or number in (0, self.our_address.system_id):
            return None
        if heartbeat.type in DRIVEN:
            persona = persona_of(heartbeat, honours_yaw_rate=self._settings.yaw_rate == "honoured")
            words = f"has autopilot type {heartbeat.autopilot}, which is not supported: not driven"
        else:  # other types give the mode numbers other meanings
            persona = None
            words = f"has vehicle type {heartbeat.type}, not that of a rover: not driven"
        if persona is None:
            self.note_once(number, words, now=beat.at)
        return persona

    def _note_intruder(
        self, place: Place, packet: Packet, message: m.Message | None, *, now: float
    ) -> None:
        """Handle setpoints, or our own address, from the vehicles' side: a second server drives.

        What this server has sent itself drives nothing. A rover passes it from link to link, too.
        """
        target = getattr(message, "target_system", 0)
        sent_to = self._where_sent(packet, place)
        for vehicle in self.all:
            there = vehicle.requests.place
            if sent_to == {place} and there == place:
                self.note_once(vehicle.system_id, ECHO.format(place[0]), now=now)
            elif not sent_to and target in (0, vehicle.system_id) and there[0] == place[0]:
                self.mark_dirty(vehicle)
                words = f"also controlled by {packet.source}"
                word = Word(TaskReason.OTHER_CONTROLLER, str(packet.source), words)
                vehicle.joint.on(Event.SECOND, word, now=now)
