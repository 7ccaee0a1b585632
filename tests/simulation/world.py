"""The world of a story: a server on a disk that outlives it, rovers, clients, and their judges.

It knows what happened; ``invariants.py`` says what must not, after each step of time.
"""

from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from math import ceil, hypot, inf, remainder, tau
from pathlib import Path
from zlib import crc32

from mav_tasks.engine.inputs import WallClock
from mav_tasks.in_memory import CLIENT_LINK, VEHICLE_LINK
from mav_tasks.links.memory import MemoryNet
from mav_tasks.settings import Settings
from mav_tasks.tasks.events import Event, TaskAssigned, TaskChanged, TaskSubmitted, TaskWithdrawn
from mav_tasks.tasks.goal import Drive, Move, Rotate
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from rover_sim.kinematic_bodies import kinematic_body
from rover_sim.personas import Mode, Persona
from tests.kit.bounds import Violation
from tests.kit.client import (
    ACCEPTED,
    ACK,
    ARM,
    SET_MODE,
    TASK_STATUS,
    FakeClient,
    Message,
    TaskStatus,
)
from tests.kit.halts import SWITCHED, UNHEARD, Halts
from tests.kit.mission import MISSION_ACK, Ack
from tests.kit.words import Kind, Said, Word, WordLog
from tests.kit.world import World
from tests.simulation import invariants
from tests.simulation.disk import Crash, Disk, UncertainStore
from tests.simulation.invariants import Stillness
from tests.simulation.ledger import Ledger
from tests.simulation.story import HABITS, Cast

SECOND_LINK = "server:second"
UTC = 1.8e9  # s, when the worlds begin
GRAIN = 0.01  # s; events within it are handled together, as on a busy machine
LOOK = 0.025  # s, between two looks at the rovers' true motion
FORGET = 5.0  # s, after which received packets are discarded
SAME = 2.0  # s, within which copies of a submission without a nonce are one task
IN_PROGRESS = 5  # MAV_RESULT
COMMAND_OF_ACK = slice(10, 12)  # of a whole COMMAND_ACK packet
RESULT_OF_ACK = 12
COMMAND_ID = slice(10 + 28, 10 + 30)  # of a COMMAND_LONG
SET_MODE_MESSAGE = 11
COMMANDS = (75, 76)  # COMMAND_INT, COMMAND_LONG
LATE = (SET_MODE, ARM)  # what a net may bring to a rover after a halt
SERVER = 250  # system
STALL = 0.8  # s of a stall, after which what drove is held
LOOP = 20.0  # s, in which a PX4 car drives a loop to where it was put into HOLD
SHOWN = 3.0  # s, until the server has seen and undone what came late
ENDS_WITHIN = 2.0  # s, for an orderly end of the server


@dataclass
class Asked:
    """The copies of a client's command that the server has read, and its answers."""

    copies: int = 0
    answers: int = 0
    latest: float = inf  # s, of a command without an answer; inf: none


@dataclass
class Way:
    """What a rover has truly driven: metres and radians, all its life."""

    metres: float = 0.0
    radians: float = 0.0


@dataclass
class Driven:
    """A task's goal, and what its rover had driven when it began."""

    metres: float
    radians: float
    rover: int = 0
    since: Way = field(default_factory=Way)
    is_judged: bool = True


class SimulatedWorld(World):
    """A World whose server may die, and whose invariants are judged after each step of time."""

    def __init__(
        self, folder: Path, cast: Cast, *, seed: int, persona: Persona, settings: Settings
    ) -> None:
        self.disk = Disk(folder / "tasks.sqlite3", wall_offset=UTC)
        self.disk_store = UncertainStore()
        slip = 0.1
        super().__init__(
            seed=seed,
            settings=settings,
            store=self.disk_store,
            rovers=cast.rovers,
            persona=persona,
            body=lambda start: kinematic_body(cast.frame, start=start, slip=slip, seed=None),
            more_links=(SECOND_LINK,),
        )
        self.leave(self.client)  # the clients of the story take its place
        self.ledger = Ledger()
        self.counts: Counter[str] = Counter()
        self.digest = 0  # of all sent packets, in order
        self.is_away = False  # the server: dead or frozen
        self.disturbed_at = self.started_at = -inf  # the present server: since when it runs
        self.words = WordLog(self.observers[0].ways)
        is_car = not cast.frame.turns_on_the_spot
        stops = invariants.CAR_STOPS_WITHIN if is_car else invariants.STOPS_WITHIN
        pairs = list(zip(self.rovers, self.observers, strict=True))
        self.halts = [Halts(v, o.system_id, stops_within=stops) for v, o in pairs]
        self.stillness = [Stillness(v, o, stops_within=stops) for v, o in pairs]
        self.asked: dict[tuple[str, int], Asked] = {}
        self.ways = [Way() for _ in self.rovers]
        self.driven: dict[int, Driven] = {}
        self.wishes: Counter[str] = Counter()  # submissions, by client
        self.submitted: Counter[str] = Counter()  # tasks of them
        self.faults: deque[str] = deque()  # found where no invariant looks
        self._poses = [rover.truth for rover in self.rovers]
        self._known: dict[tuple[str, int], float] = {}  # when a request was last read
        self._held: dict[str, bytes | None] = {}  # to be overtaken
        self._down_until: dict[str, float] = {}
        self._due: dict[str, float] = {}
        self._followed = 0  # events of the present server
        self._read: dict[str, int] = {}
        self._look_at = self._forget_at = 0.0
        self._death: tuple[float, bool] | None = None  # when it ended, and whether in order
        self.delayed: dict[str, float] = {}  # s, of the next command to a rover
        self.stalled: tuple[float, list[int]] = 0.0, []  # since when, and who drove a task then
        self.later: Callable[[float, Callable[[], object]], None] = lambda *_: None
        #: called when the server dies at a write
        self.on_death: Callable[[], object] = lambda: None
        for observer in self.observers:
            observer.expects_gaps = observer.batches = observer.expects_late_modes = True
            observer.brakes_first = is_car
        self.watched.loses = self._passes_by
        self.watched.on_read = self._server_reads
        self.watched.on_arrival = self._rover_hears
        self.clients = [self._add(number, habit) for number, habit in enumerate(cast.habits)]
        self.watch(self.judge)

    def _add(self, number: int, habit: str) -> FakeClient:
        link = SECOND_LINK if number == 1 else CLIENT_LINK
        client = self.add_client(f"client {number}", system_id=255 - number, server=link)
        client.heartbeats = HABITS[habit][0]
        return self.listened(client)

    def listened(self, client: FakeClient) -> FakeClient:
        """Note what a client sends from now on."""
        client.on_sent = lambda message, data: self.words.said(client, message, data, now=self.now)
        return client

    # time

    def _is_ready(self) -> bool:
        found = self.server.engine.snapshot(now=self.now).vehicles
        return self.now > 3.0 and len(found) == len(self.rovers)

    def next_due(self) -> float | None:
        """Return the time of the next event, in whole grains."""
        due = super().next_due()
        return None if due is None else max(due, ceil(due / GRAIN - 1e-6) * GRAIN)

    def step(self, *, end: float) -> bool:
        """Advance to the next event; the server may die at it."""
        try:
            return super().step(end=end)
        except Crash:
            self._dies()
            self.judge(self.now)
            return True

    # the server and its machine

    def kill(self) -> None:
        """Kill the server: what it has not stored is lost."""
        if not self.is_away:
            self._end(self.disk_store.committed(in_order=False), ended_well=False)

    def end_in_order(self) -> None:
        """End the server by SIGTERM; time passes until it has."""
        if self.is_away:
            return
        server = self.server
        self._guarded(lambda: server.shut_down(now=self.now))
        self.run_until(lambda: server.pump.is_over or self.is_away, within=ENDS_WITHIN)
        if not self.is_away:
            is_full = self.now < self.disk_store.full_until
            events = self.disk_store.committed(in_order=True)
            self._end(events, ended_well=server.pump.is_over and not is_full)

    def dies_at_write(self, number: int, *, before: bool) -> None:
        """Let the server die at one of its next writes."""
        self.disk_store.dies_in, self.disk_store.dies_before = number, before

    def start(self) -> None:
        """Start another server on the disk."""
        if self._death is None:
            return
        (died_at, well), self._death = self._death, None
        restored = self.disk.load(ended_well=well, idle=self.now - died_at)
        self.faults += self.ledger.restart(restored.tasks, killed_at=died_at)
        self.faults += invariants.lost_halts(self, restored)
        old, self.disk_store = self.disk_store, UncertainStore()
        self.disk_store.delay, self.disk_store.halts_delay = old.delay, old.halts_delay
        self.disk_store.clock = lambda: self.now
        self._followed, self.is_away, self.started_at = 0, False, self.now
        self.start_server(self.disk_store, restored)
        for halts in self.halts:
            halts.server_began(now=self.now)
        for observer in self.observers:
            paused = restored.paused.get(observer.system_id)
            observer.stopped = paused is TaskReason.STOPPED
            # the next server does not know of a takeover that did not reach the disk
            observer.taken_over &= paused is TaskReason.TAKEOVER

    def freeze(self) -> bool:
        """Stop the server's process; what is sent to it waits. Return whether it ran."""
        if self.is_away:
            return False
        found = self.server.engine.snapshot(now=self.now).vehicles
        driven = [v.system_id for v in found if v.active and v.active.state is TaskState.EXECUTING]
        self.stalled = self.now, driven
        self.leave(self.server)
        self.watched.is_server_away = self.is_away = True
        return True

    def thaw(self) -> None:
        """Let the server's process run again."""
        self.watched.is_server_away = self.is_away = False
        self.join(self.server)
        since, driven = self.stalled
        for halts in self.halts if self.now - since > STALL else ():
            if halts.system_id in driven and not halts.in_force:
                halts.person(invariants.STALL, drives=False, now=self.now)

    def step_wall_clock(self, seconds: float) -> None:
        """Make the wall clock of the server's machine jump."""
        self.disk.wall_offset += seconds
        if not self.is_away:
            news = WallClock(self.disk.wall_offset)
            self._guarded(lambda: self.server.take_in(news, now=self.now))

    def _guarded(self, act: Callable[[], object]) -> None:
        try:
            act()
        except Crash:
            self._dies()

    def _dies(self) -> None:
        self.counts["died at a write"] += 1
        self.disk_store.dies_in = 0
        self.on_death()
        self._end(self.disk_store.committed(in_order=False), ended_well=False)

    def _end(self, events: list[Event], *, ended_well: bool) -> None:
        self._follow()
        self.disk.write(events)
        self.end_server()
        for known in (self.asked, self.wishes, self.submitted, self._known):
            known.clear()  # without a nonce, only the present server knows a submission
        self.is_away = True
        self._death = self.now, ended_well
        self.disturb(0)

    # rovers and people

    def disturb(self, number: int, seconds: float = 0.0) -> None:
        """Note that a rover (0: all) may not hear the server for ``seconds`` from now."""
        self.disturbed_at = max(self.disturbed_at, self.now + seconds)
        for still, halts in zip(self.stillness, self.halts, strict=True):
            if number in (0, halts.system_id):
                still.disturbed_at = max(still.disturbed_at, self.now + seconds)
                halts.disturb(self.now + seconds)

    def link_down(self, number: int, seconds: float) -> None:
        """Take the link between the server and a rover down for ``seconds``."""
        self._down_until[f"rover{number}"] = self.now + seconds
        self.disturb(number, seconds)

    def doubt(self, number: int) -> None:
        """Note that a rover's own report of its way is wrong from now on."""
        for driven in self.driven.values():
            if driven.rover == number:
                driven.is_judged = False

    def person_turns(self, number: int, mode: Mode) -> None:
        """Let a person turn the mode switch at a rover; it counts only if the mode changes."""
        autopilot = self.rovers[number - 1].autopilot
        was_mode = autopilot.mode
        autopilot.operator_mode(mode, now=self.now)
        if autopilot.mode is not was_mode:
            drives = mode is not Mode.HOLD or self.is_away  # a server that is away saw nobody
            self.halts[number - 1].person(SWITCHED, drives=drives, now=self.now)

    def person_arms(self, number: int, *, armed: bool) -> None:
        """Let a person arm or disarm a rover; it counts only if the arming changes."""
        autopilot = self.rovers[number - 1].autopilot
        was_armed = autopilot.armed
        autopilot.operator_arm(armed, now=self.now)
        if autopilot.armed is not was_armed:
            self.halts[number - 1].person("disarmed at the rover", drives=armed, now=self.now)
            observer = self.observers[number - 1]
            if armed and observer.brakes_first and observer.ways.arms_in_hold:
                observer.may_move_until = self.now + LOOP

    # the net

    def swap_next_two(self, client: str) -> None:
        """Let a client's packet after the next one overtake the next one."""
        self._held[client] = None

    def repeat(self, said: Said, message: Message) -> None:
        """Send a client's request again, like a library without an answer."""
        data = said.client.send_repeated(message)
        self.words.note(said.client, data, first=said.first)
        self.net.send(said.client.name, said.client.server, data)

    def read_late(self, seconds: float) -> Callable[[], None]:
        """Let the server not read the second link for a while; return what ends that."""
        self.watched.unread_links.setdefault(SECOND_LINK, [])
        self.disturb(0, seconds - 6.0)
        return partial(self.watched.read_again, SECOND_LINK)

    def _passes_by(self, source: str, target: str, data: bytes) -> bool:
        self.digest = crc32(f"{self.now!r} {source} {target} ".encode() + data, self.digest)
        self.counts["packets"] += 1
        if source in self.watched.to_clients and data[7:10] == ACK.to_bytes(3, "little"):
            self._server_answers(target, data)
        if target in self.delayed and source == VEHICLE_LINK and _command_in(data) in LATE:
            self.later(self.delayed.pop(target), partial(self._comes_late, target, data))
            return True
        if source in self._held:
            return self._is_overtaken(source, target, data)
        rover = target if source == VEHICLE_LINK else source
        return self._down_until.get(rover, -inf) > self.now

    def _comes_late(self, rover: str, data: bytes) -> None:
        number = int(rover.removeprefix("rover"))
        self.disturb(number, SHOWN - UNHEARD)
        MemoryNet.send(self.net, VEHICLE_LINK, rover, data)  # it left before

    def _is_overtaken(self, source: str, target: str, data: bytes) -> bool:
        first = self._held[source]
        if first is None:
            self._held[source] = data
        else:
            del self._held[source]
            self.net.send(source, target, data)
            self.net.send(source, target, first)
        return True

    def _server_reads(self, peer: str, data: bytes, waited: float) -> None:
        word = self.words.word(peer, data)
        if word is None:
            return
        seen = {v.system_id: v for v in self.server.engine.snapshot(now=self.now).vehicles}
        self._note_asked(word, is_known=word.system_id in (0, SERVER, *seen))
        for halts in self.halts:
            vehicle = seen.get(halts.system_id)
            active = None if vehicle is None else vehicle.active
            running = None if active is None else int(active.id)
            has_tasks = active is not None or (vehicle is not None and bool(vehicle.waiting))
            halts.read(word, running=running, has_tasks=has_tasks, waited=waited, now=self.now)

    def _note_asked(self, word: Word, *, is_known: bool) -> None:
        if not word.command:
            return
        asked = self.asked.setdefault((word.peer, word.command), Asked())
        asked.copies += 1
        key = word.peer, word.order
        if key not in self._known:
            asked.latest = self.now if is_known else asked.latest
        if self.now - self._known.get(key, -inf) > SAME:
            self.wishes[word.peer] += word.kind is Kind.WISH
        self._known[key] = self.now

    def _server_answers(self, peer: str, data: bytes) -> None:
        command = int.from_bytes(data[COMMAND_OF_ACK], "little")
        result = data[RESULT_OF_ACK] if data[1] > RESULT_OF_ACK - 10 else 0
        asked = self.asked.get((peer, command))
        if asked is not None and result != IN_PROGRESS:
            asked.answers += 1
            asked.latest = inf
            if asked.answers > asked.copies:
                self.faults.append(f"command {command} of {peer} is answered {asked.answers} times")
        for halts in self.halts:
            if halts.system_id == data[5]:
                halts.answered(peer, command, result, now=self.now)

    def _rover_hears(self, rover: str, source: str, data: bytes) -> None:
        halts = self.halts[int(rover.removeprefix("rover")) - 1]
        if source != VEHICLE_LINK:
            halts.pushed()
        elif data[5] != SERVER:
            halts.passed(_command_in(data), now=self.now)
        if data[7] == SET_MODE_MESSAGE or _command_in(data) == SET_MODE:
            halts.mode_arrived(now=self.now)

    # judging

    def judge(self, now: float, *, everything: bool = False) -> None:
        """Raise Violation for each invariant that is due and does not hold."""
        self._follow()
        if now >= self._look_at:
            self._look_at = now + LOOK
            self._measure()
        for text in self.faults:
            raise self.violation("tasks and answers", text)
        for name, (period, check) in invariants.INVARIANTS.items():
            if everything or now >= self._due.get(name, 0.0):
                self._due[name] = now + period
                for text in check(self):
                    raise self.violation(name, text)
        if now >= self._forget_at:
            self._forget_at = now + FORGET
            self._forget()

    def violation(self, name: str, text: str) -> Violation:
        """Return the error for a broken rule."""
        found = Violation(f"{name}: {text}")
        found.add_note(f"{self.now:.3f} s: {self.describe()}")
        return found

    def _measure(self) -> None:
        for number, rover in enumerate(self.rovers):
            was, now = self._poses[number], rover.truth
            self.ways[number].metres += hypot(now.north - was.north, now.east - was.east)
            self.ways[number].radians += abs(remainder(now.yaw - was.yaw, tau))
            self._poses[number] = now

    def _follow(self) -> None:
        """Take the new events of the server, and the packets that clients have received."""
        events = self.disk_store.events
        if self._followed < len(events):
            new = events[self._followed :]
            self.faults += self.ledger.follow(new)
            for event in new:
                self._see(event)
            self._followed = len(events)
        for client in self.clients:
            heard = client.received
            for packet in heard[self._read.get(client.name, 0) :]:
                if packet.message_id == TASK_STATUS:
                    status = TaskStatus.of(packet.payload)
                    self.faults += self.ledger.tell(status, client.name)
                elif packet.message_id == MISSION_ACK:
                    ack = Ack.of(packet.payload)
                    if ack.result == ACCEPTED and ack.opaque_id and not ack.kind:
                        self.faults += self.ledger.accept(ack.opaque_id, client.name)
            self._read[client.name] = len(heard)
            for answer in client.acks:
                if answer.command in invariants.TASKS and answer.result == ACCEPTED:
                    self.faults += self.ledger.accept(answer.result_param2, client.name)
            client.acks.clear()

    def _see(self, event: Event) -> None:
        match event:
            case TaskSubmitted(task=task):
                self.counts["tasks"] += 1
                goal = task.goal
                metres = abs(goal.distance) if isinstance(goal, Move) else 0.0
                radians = abs(goal.angle) if isinstance(goal, Rotate) else 0.0
                if isinstance(goal, Drive):
                    metres = abs(goal.forward) * goal.duration
                self.driven[task.id] = Driven(metres, radians)
                if task.command in invariants.TASKS:
                    self.submitted[task.submitter.endpoint] += 1
                    most = self.wishes[task.submitter.endpoint]
                    if self.submitted[task.submitter.endpoint] > most:
                        self.faults.append(f"{most} submissions have become more tasks")
            case TaskWithdrawn():
                self.submitted.clear()
            case TaskChanged(task_id=task_id, vehicle=vehicle, new=TaskState.STARTING):
                self.halts[vehicle - 1].began_task()
                driven = self.driven[task_id]
                if driven.rover != vehicle:
                    way = self.ways[vehicle - 1]
                    driven.rover, driven.since = vehicle, Way(way.metres, way.radians)
            case TaskChanged(task_id=task_id, new=TaskState.COMPLETED):
                self.counts["completed"] += 1
                self.faults += invariants.not_driven(self, task_id)
            case TaskAssigned(task_id=task_id, before=before):
                self.faults += invariants.taken_from_halted(self, task_id, before)

    def _forget(self) -> None:
        for client in self.clients:
            client.received.clear()
            self._read[client.name] = 0
        for observer in self.observers:
            observer.driven.clear()
            observer.reached.clear()


def _command_in(data: bytes) -> int:
    """Return the number of the command in a packet, 0 if it holds none."""
    return int.from_bytes(data[COMMAND_ID], "little") if data[7] in COMMANDS else 0
