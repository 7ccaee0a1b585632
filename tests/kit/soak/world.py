"""A long-lived world: links go down, servers end and restart, rules hold at each step."""

from collections import Counter
from collections.abc import Callable, Iterator
from math import ceil, inf
from pathlib import Path
from random import Random
from zlib import crc32

from mav_tasks.engine.inputs import WallClock
from mav_tasks.in_memory import CLIENT_LINK, VEHICLE_LINK
from mav_tasks.links.memory import Conditions
from mav_tasks.settings import Settings
from mav_tasks.tasks.events import Event, TaskChanged
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from rover_sim.personas import Mode, Persona
from tests.kit.client import (
    ACCEPTED,
    ACK,
    DRIVE,
    MOVE,
    ROTATE,
    SET_MODE,
    TASK_STATUS,
    FakeClient,
    Message,
    TaskStatus,
)
from tests.kit.halts import Broken, Halts
from tests.kit.mission import MISSION_ACK, Ack
from tests.kit.soak.bounds import too_large
from tests.kit.soak.disk import Disk, UncertainStore
from tests.kit.soak.ledger import Ledger
from tests.kit.soak.stillness import Stillness
from tests.kit.soak.words import Said, WordLog
from tests.kit.world import MODE_COMMAND, World

UTC = 1.8e9  # s, when the worlds begin
GRAIN = 0.01  # s; events within it are handled together, as on a busy machine
CONTROL_STEP = 0.025  # s, between two checks of the rovers' true motion
FORGET = 5.0  # s, after which received packets are discarded
LOOK_THROUGH = 20.0  # s, between two size checks of the server's memory
TASK_COMMANDS = (MOVE, ROTATE, DRIVE)
COMMAND_OF_ACK = slice(10, 12)  # of a whole COMMAND_ACK packet
RESULT_OF_ACK = 12
COMMAND_ID = slice(10 + 28, 10 + 30)  # of a COMMAND_LONG
SET_MODE_MESSAGE = 11
COMMANDS = (75, 76)  # COMMAND_INT, COMMAND_LONG
SERVER = 250  # system
ENDS_WITHIN = 2.0  # s, for an orderly end of the server
MEANWHILE = (0.1, 0.5, 2.0)  # s, between two actions of clients while the server is stopped


class Violation(AssertionError):
    """A rule was broken; the text has rule, time and seed."""


class SoakWorld(World):
    """A World with a disk that outlives its servers. Rules are judged after each step of time."""

    def __init__(
        self,
        folder: Path,
        *,
        seed: int,
        rovers: int,
        persona: Persona,
        conditions: Conditions,
        settings: Settings | None = None,
    ) -> None:
        self.disk = Disk(folder / "tasks.sqlite3", wall_offset=UTC)
        self.disk_store = UncertainStore()
        super().__init__(
            seed=seed,
            conditions=conditions,
            settings=settings,
            store=self.disk_store,
            rovers=rovers,
            persona=persona,
        )
        self.ledger = Ledger()
        self.clients: list[FakeClient] = [self.client]
        self.faults: Counter[str] = Counter()
        self.packets = 0
        self.digest = 0  # of all sent packets, in order
        self.restarts = 0
        self._down_until: dict[str, float] = {}
        self._stillness = [
            Stillness(vehicle, observer)
            for vehicle, observer in zip(self.rovers, self.observers, strict=True)
        ]
        self.words = WordLog(self.observers[0].ways)
        self.halts = [
            Halts(vehicle, observer.system_id)
            for vehicle, observer in zip(self.rovers, self.observers, strict=True)
        ]
        self.deeds: Counter[str] = Counter()  # of attackers, by name
        self.broken: list[Broken] = []
        self._luck = Random(seed)  # for actions while the server is stopped
        self._held: tuple[str, bytes | None] | None = None  # to be overtaken
        self._followed = 0  # events of the present server
        self._read: dict[str, int] = {}  # number of events of the present server
        self._look_at = self._compare_at = self._forget_at = self._walk_at = 0.0
        for observer in self.observers:
            observer.expects_gaps = observer.batches = observer.expects_late_modes = True
        self.watched.loses = self._passes_by
        self.watched.on_read = self._server_reads
        self.watched.on_arrival = self._rover_hears
        self._listen_to(self.client)
        self.watch(self._judge)

    def next_due(self) -> float | None:
        """Return the time of the next event, in whole grains."""
        due = super().next_due()
        return None if due is None else max(due, ceil(due / GRAIN - 1e-6) * GRAIN)

    # faults

    def link_down(self, number: int, seconds: float) -> None:
        """Take the link between the server and a rover down for ``seconds``."""
        self.faults["link down"] += 1
        self._down_until[f"rover{number}"] = self.now + seconds
        self.disturb(number, seconds)

    def disturb(self, number: int, seconds: float = 0.0) -> None:
        """Note that a rover may not hear the server for ``seconds`` from now."""
        for still in self._stillness:
            if number in (0, still.observer.system_id):
                still.disturbed_at = max(still.disturbed_at, self.now + seconds)
        for halts in self.halts:
            if number in (0, halts.system_id):
                halts.disturb(self.now + seconds)

    def step_wall_clock(self, seconds: float) -> None:
        """Make the wall clock of the server's machine jump."""
        self.faults["wall clock jumps"] += 1
        self.disk.wall_offset += seconds
        self.server.pump.handle(WallClock(self.disk.wall_offset), now=self.now)
        self.server.pump.turn(now=self.now)

    def restart(self, *, away: float) -> None:
        """Kill the server, and start another on the disk's contents."""
        self.faults["server killed"] += 1
        self._restart(away=away)

    def restart_in_order(self, *, away: float) -> None:
        """End the server by SIGTERM, and start another on the disk's contents."""
        self.faults["server ended"] += 1
        server = self.server
        server.shut_down(now=self.now)
        self.run_until(lambda: server.pump.is_over, within=ENDS_WITHIN)
        self._restart(away=away)

    def freeze(self, seconds: float, meanwhile: Callable[[], object]) -> None:
        """Stop the server's process while clients continue; their packets wait for it."""
        end = self.now + seconds
        self.leave(self.server)
        self.watched.is_server_away = True
        while self.now < end:
            meanwhile()
            self.run(min(self._luck.choice(MEANWHILE), end - self.now))
        self.watched.is_server_away = False
        self.join(self.server)

    def suspend_machine(self, seconds: float, meanwhile: Callable[[], object]) -> None:
        """Suspend the server's machine; its clock continues (CLOCK_BOOTTIME)."""
        self.freeze(seconds, meanwhile)

    def swap_next_two(self, client: FakeClient) -> None:
        """Let a client's packet after the next one overtake the next one."""
        self._held = client.name, None

    def repeat(self, said: Said, message: Message) -> None:
        """Send a client's request again, like a library without an answer."""
        data = said.client.send_repeated(message)
        self.words.note(said.client, data, first=said.first)
        self.net.send(said.client.name, said.client.server, data)

    def person_turns(self, number: int, mode: Mode) -> None:
        """Let a person turn the mode switch at a rover; report it only if the mode changes."""
        autopilot = self.rovers[number - 1].autopilot
        was_mode = autopilot.mode
        autopilot.operator_mode(mode, now=self.now)
        if autopilot.mode is was_mode:
            return
        drives = mode is not Mode.HOLD
        self.halts[number - 1].person("HOLD at the rover", drives=drives, now=self.now)

    def person_arms(self, number: int, *, armed: bool) -> None:
        """Let a person arm or disarm a rover; report it only if the arming changes."""
        autopilot = self.rovers[number - 1].autopilot
        was_armed = autopilot.armed
        autopilot.operator_arm(armed, now=self.now)
        if autopilot.armed is was_armed:
            return
        self.halts[number - 1].person("disarmed at the rover", drives=armed, now=self.now)

    def _restart(self, *, away: float) -> None:
        self.restarts += 1
        self._follow()
        self.disk.write(self.disk_store.committed(), now=self.now)
        self.end_server()
        killed_at = self.now
        self.disturb(0, away + 1.0)
        self.run(away)
        restored = self.disk.load(ended_well=False, idle=away)
        self._raise(self.ledger.restart(restored.tasks, killed_at=killed_at))
        self._followed = 0
        delay = self.disk_store.delay
        self.disk_store = UncertainStore()
        self.disk_store.delay, self.disk_store.clock = delay, lambda: self.now
        self.start_server(self.disk_store, restored)
        for observer in self.observers:
            paused = restored.paused.get(observer.system_id)
            observer.stopped = paused is TaskReason.STOPPED
            # the next server does not know of a takeover that did not reach the disk
            observer.taken_over &= paused is TaskReason.TAKEOVER

    # participants

    def add_soaked_client(self, name: str, *, system_id: int) -> FakeClient:
        """Add a client whose acks are checked."""
        client = self.add_client(name, system_id=system_id)
        self._listen_to(client)
        self.clients.append(client)
        return client

    # rules

    def judge_all(self) -> None:
        """Judge everything now, including the periodic checks."""
        self._look_at = self._compare_at = self._walk_at = -inf
        self._judge(self.now)

    def _judge(self, now: float) -> None:
        self._follow()
        if now >= self._look_at:
            self._look_at = now + CONTROL_STEP
            for still in self._stillness:
                self._raise(still.look(now))
            for halts in self.halts:
                self.broken += halts.look(now)
            for observer in self.observers:
                if observer.violations:
                    self._raise(iter([f"rover {observer.system_id}: {observer.violations[0]}"]))
        if now >= self._compare_at:
            self._compare_at = now + 1.0
            self._raise(self.ledger.compare(self.server.engine.snapshot(now=now).tasks))
        if now >= self._walk_at:
            self._walk_at = now + LOOK_THROUGH
            self._raise(too_large(self.server.engine))
        if now >= self._forget_at:
            self._forget_at = now + FORGET
            self._forget()

    def _follow(self) -> None:
        """Check the server's events and clients' received packets since the last step."""
        events = self.disk_store.events
        if self._followed < len(events):
            self._raise(self.ledger.follow(events[self._followed :]))
            self._see_beginnings(events[self._followed :])
            self._followed = len(events)
        for client in self.clients:
            heard = client.received
            for packet in heard[self._read.get(client.name, 0) :]:
                if packet.message_id == TASK_STATUS:
                    status = TaskStatus.of(packet.payload)
                    self._raise(self.ledger.tell(status, client.name))
                elif packet.message_id == MISSION_ACK:
                    ack = Ack.of(packet.payload)
                    if ack.result == ACCEPTED and ack.opaque_id and not ack.kind:
                        self._raise(self.ledger.accept(ack.opaque_id, client.name))
            self._read[client.name] = len(heard)
            for answer in client.acks:
                if answer.command in TASK_COMMANDS and answer.result == ACCEPTED:
                    self._raise(self.ledger.accept(answer.result_param2, client.name))
            client.acks.clear()

    def _forget(self) -> None:
        for client in self.clients:
            client.received.clear()
            self._read[client.name] = 0
        for observer in self.observers:
            observer.driven.clear()
            observer.reached.clear()

    def _passes_by(self, source: str, target: str, data: bytes) -> bool:
        self.packets += 1
        self.digest = crc32(f"{self.now!r} {source} {target} ".encode() + data, self.digest)
        if source == CLIENT_LINK and data[7:10] == ACK.to_bytes(3, "little"):
            self._server_answers(target, data)
        if target == CLIENT_LINK and self._held is not None and self._held[0] == source:
            return self._is_overtaken(source, data)
        rover = target if source == VEHICLE_LINK else source
        return self._down_until.get(rover, -inf) > self.now

    # for the halt rule

    def _listen_to(self, client: FakeClient) -> None:
        client.on_sent = lambda message, data: self.words.said(client, message, data, now=self.now)

    def _server_reads(self, peer: str, data: bytes) -> None:
        word = self.words.word(peer, data)
        if word is None:
            return
        seen = {v.system_id: v for v in self.server.engine.snapshot(now=self.now).vehicles}
        for halts in self.halts:
            vehicle = seen.get(halts.system_id)
            active = None if vehicle is None else vehicle.active
            running = None if active is None else int(active.id)
            has_tasks = active is not None or (vehicle is not None and bool(vehicle.waiting))
            halts.read(word, running=running, has_tasks=has_tasks, now=self.now)

    def _server_answers(self, peer: str, data: bytes) -> None:
        command = int.from_bytes(data[COMMAND_OF_ACK], "little")
        result = data[RESULT_OF_ACK] if data[1] > RESULT_OF_ACK - 10 else 0
        for halts in self.halts:
            if halts.system_id == data[5]:
                halts.answered(peer, command, result, now=self.now)

    def _rover_hears(self, rover: str, source: str, data: bytes) -> None:
        halts = self.halts[int(rover.removeprefix("rover")) - 1]
        if source != VEHICLE_LINK:
            halts.pushed()
        elif data[5] != SERVER and data[7] in COMMANDS:
            halts.passed(int.from_bytes(data[COMMAND_ID], "little"), now=self.now)
        elif data[7] == SET_MODE_MESSAGE or (
            data[7] == MODE_COMMAND and data[COMMAND_ID] == SET_MODE.to_bytes(2, "little")
        ):
            halts.mode_arrived(now=self.now)

    def _see_beginnings(self, events: list[Event]) -> None:
        vehicles = {task_id: mark[2] for task_id, mark in self.ledger.given.items()}
        for event in events:
            if isinstance(event, TaskChanged) and event.new is TaskState.STARTING:
                for halts in self.halts:
                    if halts.system_id == vehicles.get(int(event.task_id)):
                        halts.began_task()

    def _is_overtaken(self, source: str, data: bytes) -> bool:
        """Hold a packet back until its sender's next one; return True: the net drops it."""
        assert self._held is not None
        _, first = self._held
        if first is None:
            self._held = source, data
            return True
        self._held = None
        self.net.send(source, CLIENT_LINK, data)
        self.net.send(source, CLIENT_LINK, first)
        return True

    def _raise(self, faults: Iterator[str]) -> None:
        for text in faults:
            raise Violation(f"seed {self.seed}, {self.now:.3f} s: {text}\n{self.describe()}")
