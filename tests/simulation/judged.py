"""A world with its judges: what clients asked for, what rovers did, and the rules between them.

It knows what happened; ``invariants.py`` says what must not, after each step of time. The servers,
which may die, are in ``world.py`` and ``fleet.py``.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import ceil, hypot, inf, remainder, tau
from typing import Any
from zlib import crc32

from mav_tasks import kinds as g
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.snapshot import VehicleSnapshot
from mav_tasks.links.memory import MemoryNet
from mav_tasks.tasks.events import Event, TaskAssigned, TaskChanged, TaskSubmitted, TaskWithdrawn
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.restored import Restored
from rover_sim.kinematic_bodies import kinematic_body
from rover_sim.personas import Mode
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
from tests.simulation.invariants import Stillness
from tests.simulation.ledger import Ledger
from tests.simulation.story import HABITS, Cast, Move

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
LOOP = 20.0  # s, in which a PX4 car drives a loop to where it was put into HOLD
SHOWN = 3.0  # s, until the server has seen and undone what came late


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


class JudgedWorld(World):
    """A World whose invariants are judged after each step of time."""

    def __init__(self, cast: Cast, *args: Any, client_links: Sequence[str], **kw: Any) -> None:
        """Create a world of a cast, whose clients are at ``client_links``, one after another."""
        slip = 0.1
        super().__init__(
            *args,
            rovers=cast.rovers,
            body=lambda start: kinematic_body(cast.frame, start=start, slip=slip, seed=None),
            **kw,
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
        self._followed = 0  # events of the journal
        self._read: dict[str, int] = {}
        self._look_at = self._forget_at = 0.0
        self.delayed: dict[str, float] = {}  # s, of the next command to a rover
        self.later: Callable[[float, Callable[[], object]], None] = lambda *_: None
        for observer in self.observers:
            observer.expects_gaps = observer.batches = observer.expects_late_modes = True
            observer.brakes_first = is_car
        self.watched.loses = self._passes_by
        self.watched.on_read = self._server_reads
        self.watched.on_arrival = self._rover_hears
        self.senders: dict[str, FakeClient] = {}  # by name
        self.clients = [
            self._add(number, habit, client_links[number % len(client_links)])
            for number, habit in enumerate(cast.habits)
        ]
        self.watch(self.judge)

    def _add(self, number: int, habit: str, link: str) -> FakeClient:
        client = self.add_client(f"client {number}", system_id=255 - number, server=link)
        client.heartbeats = HABITS[habit][0]
        return self.listened(client)

    def listened(self, client: FakeClient) -> FakeClient:
        """Note what a client sends from now on."""
        self.senders[client.name] = client
        client.on_sent = lambda message, data: self.words.said(client, message, data, now=self.now)
        return client

    # what servers tell

    @property
    def journal(self) -> Sequence[Event]:
        """The events of the present server, or of all gateways."""
        raise NotImplementedError

    def fails(self, move: Move) -> None:
        """Let something happen to a server, its disk or its clock."""
        raise NotImplementedError

    def engines(self) -> list[Engine]:
        """Return the engines of the servers that run."""
        return [] if self.is_away else [self.server.engine]

    def calm(self) -> None:
        """End all that was wrong with servers and disks."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the files."""
        raise NotImplementedError

    def seen(self) -> dict[int, VehicleSnapshot]:
        """Return the rovers as their server sees them, by system id."""
        return {
            vehicle.system_id: vehicle
            for engine in self.engines()
            for vehicle in engine.snapshot(now=self.now).vehicles
        }

    # time

    def _is_ready(self) -> bool:
        return self.now > 3.0 and len(self.seen()) == len(self.rovers)

    def next_due(self) -> float | None:
        """Return the time of the next event, in whole grains."""
        due = super().next_due()
        return None if due is None else max(due, ceil(due / GRAIN - 1e-6) * GRAIN)

    def _forget_requests(self) -> None:
        """Forget what only a server that has ended knew: its debts of answers, what it had read."""
        for known in (self.asked, self.submitted, self._known):
            known.clear()

    def _restored(self, rover: int, restored: Restored) -> None:
        """Note that a server serves a rover from now on, with what the disk has of it."""
        halts, observer = self.halts[rover - 1], self.observers[rover - 1]
        self.faults += invariants.lost_halts(halts, restored)
        halts.server_began(now=self.now)
        paused = restored.paused.get(rover)
        observer.stopped = paused is TaskReason.STOPPED
        # the next server does not know of a takeover that did not reach the disk
        observer.taken_over &= paused is TaskReason.TAKEOVER

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

    def _passes_by(self, source: str, target: str, data: bytes) -> bool:
        self.digest = crc32(f"{self.now!r} {source} {target} ".encode() + data, self.digest)
        self.counts["packets"] += 1
        if source in self.watched.to_clients and data[7:10] == ACK.to_bytes(3, "little"):
            self._server_answers(target, data)
        to_rover = source in self.watched.to_vehicles
        if target in self.delayed and to_rover and _command_in(data) in LATE:
            self.later(self.delayed.pop(target), partial(self._comes_late, source, target, data))
            return True
        if source in self._held:
            return self._is_overtaken(source, target, data)
        rover = target if to_rover else source
        return self._down_until.get(rover, -inf) > self.now

    def _comes_late(self, source: str, rover: str, data: bytes) -> None:
        number = int(rover.removeprefix("rover"))
        self.disturb(number, SHOWN - UNHEARD)
        MemoryNet.send(self.net, source, rover, data)  # it left before

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
        self._note_asked(word, is_known=word.system_id in (0, SERVER, *self.seen()))
        self._obeys(word, waited, self.halts)

    def _obeys(self, word: Word, waited: float, whose: Iterable[Halts]) -> None:
        """Note that the server of some rovers has a request before it."""
        seen = self.seen()
        for halts in whose:
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
        if source not in self.watched.to_vehicles:
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
        events = self.journal
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
                metres = abs(goal.distance) if isinstance(goal, g.Move) else 0.0
                radians = abs(goal.angle) if isinstance(goal, g.Rotate) else 0.0
                if isinstance(goal, g.Drive):
                    metres = abs(goal.forward) * goal.duration
                self.driven[task.id] = Driven(metres, radians)
                if task.command in invariants.TASKS:
                    system = task.submitter.system_id
                    client = next(n for n, c in self.senders.items() if c.system_id == system)
                    self.submitted[client] += 1
                    most = self.wishes[client]
                    if self.submitted[client] > most:
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
