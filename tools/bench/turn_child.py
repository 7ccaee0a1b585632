"""Measures one engine in this process, on commands from stdin: calls or CPU time of a turn.

It runs with the modules of any revision that has ``mav_tasks.engine.engine`` on its path, so it
imports nothing of this package: ``PYTHONPATH=TREE python -P tools/bench/turn_child.py``. It answers
a line ``calls`` or ``cpu TURNS`` with a line of JSON.

A turn is the engine's work on a TASK_MOVE: ``handle(Packets)``, ``take_packets``, ``take_events``,
then ``handle(Committed)``, ``take_packets``, ``take_events``. The rover is armed and in HOLD, one
task is starting (the rover does not follow the mode request yet), and ten wait: the submission is
only queued, and answered by COMMAND_ACK, STATUSTEXT and TASK_STATUS.

An idle wake-up is ``handle_deadline``, ``take_packets``, ``take_events`` and ``next_deadline``,
with one rover that stands disarmed in HOLD, sends the requested telemetry, and has no task.
"""

import json
import sys
from collections import Counter
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from time import process_time_ns
from types import FrameType
from typing import Any

from mav_tasks.config.settings import Clients, Limits, Queueing, Roles, Settings
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import Committed, LinkChanged, LinkSide, Outgoing, Packets
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.packet import split_datagram

CLIENTS, VEHICLES, CLIENT, ROVER = "clients", "vehicles", "client", "rover"
HOLD, ARMED, CUSTOM = 4, 128, 1  # ArduPilot Rover's mode, MAV_MODE_FLAG
MOVE, REQUEST = 54000, 512
WAITING = 10  # tasks
BEAT, TELEMETRY = 1.0, 0.05  # s
MEETING = 5.0  # s, after which the server knows the rover
SETTLED = 30.0  # s, after which the server's requests to the rover have ended
APART = 0.1  # s, between the submissions of the waiting tasks
BETWEEN = 0.001  # s of virtual time between two turns
AT_ONCE = 100  # turns with one engine; more would outlast the starting of the task
WATCHED = 10.0  # s in which idle wake-ups are counted


class Calls:
    """Counts calls while entered: Python functions by name, and C functions.

    It counts the events "call" and "c_call" of ``sys.setprofile``. A comprehension is a function up
    to Python 3.11, and each step of a generator is a call. Its own calls are not counted.
    """

    def __init__(self) -> None:
        self.of: Counter[str] = Counter()
        self.of_c: Counter[str] = Counter()

    def __enter__(self) -> "Calls":
        sys.setprofile(self._note)
        return self

    def __exit__(self, *_: object) -> None:
        sys.setprofile(None)
        self.of.pop("turn_child.py:Calls.__exit__", None)
        self.of_c.pop("setprofile", None)

    def _note(self, frame: FrameType, event: str, what: Any) -> None:
        if event == "call":
            code = frame.f_code
            self.of[_made(frame) or f"{_short(code.co_filename)}:{code.co_qualname}"] += 1
        elif event == "c_call":
            self.of_c[what.__qualname__] += 1


def _made(frame: FrameType) -> str:
    """Return the class of a generated constructor (a dataclass or a named tuple), or ""."""
    if frame.f_code.co_filename != "<string>":
        return ""
    kind = frame.f_locals.get("_cls") or type(frame.f_locals.get("self"))
    return f"{kind.__name__}()"


def _short(path: str) -> str:
    return path.rpartition("mav_tasks/")[2].rpartition("/tools/bench/")[2]


class Clock:
    """Adds up CPU nanoseconds while entered."""

    def __init__(self) -> None:
        self.spent = 0
        self._began = 0

    def __enter__(self) -> "Clock":
        self._began = process_time_ns()
        return self

    def __exit__(self, *_: object) -> None:
        self.spent += process_time_ns() - self._began


class Stand:
    """An engine with a scripted rover and client, in virtual time."""

    def __init__(self, *, base_mode: int) -> None:
        unlimited = Limits(quota=10_000_000, rate=1e9)
        settings = Settings(
            queueing=Queueing(capacity=10_000_000, quota=10_000_000),
            clients=Clients(stream_interval=0.0, packet_rate=1e9),
            roles=Roles(safety=unlimited),
            arming="operator",
        )
        self.now = 0.0
        self.engine = Engine(settings, now=0.0)
        self._base_mode = base_mode
        self._rover, self._client = Encoder(Address(1, 1)), Encoder(Address(245, 190))
        self._decoder = Decoder()
        self._events = 0
        self._submitted = 0
        self._beat_at = self._telemetry_at = 0.0
        self._take(LinkChanged(VEHICLES, LinkSide.VEHICLES, True, (ROVER,)))
        self._take(LinkChanged(CLIENTS, LinkSide.CLIENTS, True))

    def turn(self, packet: bytes, measure: AbstractContextManager[object]) -> list[Outgoing]:
        """Let the engine answer the client's packet, and measure the effort."""
        engine, now = self.engine, self.now
        with measure:
            engine.handle(Packets(CLIENTS, [(CLIENT, packet)]), now=now)
            packets = engine.take_packets()
            events = engine.take_events()
        self._events += len(events)
        with measure:
            engine.handle(Committed(self._events), now=now)
            answers = engine.take_packets()
            events = engine.take_events()
        self._events += len(events)
        return [*packets, *answers]

    def wake_up(self, measure: AbstractContextManager[object]) -> list[Outgoing]:
        """Run due work, and measure the effort."""
        engine, now = self.engine, self.now
        with measure:
            engine.handle_deadline(now=now)
            packets = engine.take_packets()
            events = engine.take_events()
            engine.next_deadline()
        self._events += len(events)
        return packets

    def run(self, seconds: float, look: Callable[[], list[Outgoing]] | None = None) -> None:
        """Advance time; ``look`` replaces the due work and returns its packets."""
        end = self.now + seconds
        while self.now < end:
            due = self.engine.next_deadline() or end
            self.now = min(end, due, self._beat_at, self._telemetry_at)
            if due <= self.now:
                for outgoing in self.wake_up(nullcontext()) if look is None else look():
                    self._hear(outgoing)
                self._drain()
            if self._telemetry_at <= self.now:
                self._telemetry_at += TELEMETRY
                self._move_on()
            if self._beat_at <= self.now:
                self._beat_at += BEAT
                self._live()

    def move(self) -> bytes:
        """Return a packet that submits another task."""
        self._submitted += 1
        return self._command(MOVE, 1.0, 0.0, 0.0, self._submitted, 0.0, 0.0, 5.0)

    def say(self, packet: bytes) -> None:
        """Send a packet from the client, and process its consequences."""
        self._take(Packets(CLIENTS, [(CLIENT, packet)]))

    def _command(self, command: int, *params: float) -> bytes:
        filled = (*params, *(0.0,) * (7 - len(params)))
        return self._client.encode(m.CommandLong(1, 191, command, 0, *filled))

    def _live(self) -> None:
        beat = m.Heartbeat(10, 3, self._base_mode, HOLD, 3, 3)
        self._take(Packets(VEHICLES, [(ROVER, self._rover.encode(beat))]))
        station = m.Heartbeat(6, 8, 0, 0, 4, 3)
        self._take(Packets(CLIENTS, [(CLIENT, self._client.encode(station))]))

    def _move_on(self) -> None:
        boot = round(self.now * 1000)
        for message in (
            m.Attitude(boot, 0, 0, 0, 0, 0, 0),
            m.LocalPositionNed(boot, 0, 0, 0, 0, 0, 0),
            m.GlobalPositionInt(boot, 0, 0, 0, 0, 0, 0, 0, 0),
        ):
            self._take(Packets(VEHICLES, [(ROVER, self._rover.encode(message))]))

    def _take(self, item: Packets | LinkChanged) -> None:
        self.engine.handle(item, now=self.now)
        self._drain()

    def _drain(self) -> None:
        """Let the rover accept every command, and commit every event."""
        while True:
            packets, events = self.engine.take_packets(), self.engine.take_events()
            for outgoing in packets:
                self._hear(outgoing)
            if events:
                self._events += len(events)
                self.engine.handle(Committed(self._events), now=self.now)
            elif not packets:
                return

    def _hear(self, outgoing: Outgoing) -> None:
        """Let the rover answer requests."""
        for packet in split_datagram(outgoing.data) if outgoing.link == VEHICLES else ():
            message = self._decoder.decode(packet)
            if isinstance(message, m.CommandLong):
                answers: list[m.Message] = [m.CommandAck(message.command, 0)]
                if (message.command, message.param1) == (REQUEST, m.AutopilotVersion.id):
                    answers.append(
                        m.AutopilotVersion(0, 1, 1, 1, 1, [0] * 8, [0] * 8, [0] * 8, 1, 1, 1)
                    )
                for answer in answers:
                    told = Packets(VEHICLES, [(ROVER, self._rover.encode(answer))])
                    self.engine.handle(told, now=self.now)


def stand_with_queue() -> Stand:
    """Return an engine in the state in which turns are measured."""
    stand = Stand(base_mode=CUSTOM | ARMED)
    stand.run(MEETING)
    for _ in range(WAITING):
        stand.say(stand.move())
        stand.run(APART)
    return stand


def counted_turn() -> dict[str, Any]:
    """Return the calls of one turn; the first turns only warm up the engine."""
    stand = stand_with_queue()
    for _ in range(3):
        stand.run(3 * APART)
        packet = stand.move()
        calls = Calls()
        packets = stand.turn(packet, calls)
    return _said(calls, packets)


def counted_wake_ups() -> list[dict[str, Any]]:
    """Return the calls of each wake-up during WATCHED idle seconds."""
    stand = Stand(base_mode=CUSTOM)
    stand.run(SETTLED)
    counted: list[dict[str, Any]] = []

    def look() -> list[Outgoing]:
        calls = Calls()
        packets = stand.wake_up(calls)
        counted.append(_said(calls, packets))
        return packets

    stand.run(WATCHED, look)
    return counted


def cpu(turns: int) -> float:
    """Return the mean CPU seconds of a turn, over at least ``turns`` turns."""
    clock, rounds = Clock(), -(-turns // AT_ONCE)
    for _ in range(rounds):
        stand = stand_with_queue()
        for _ in range(AT_ONCE):
            stand.run(BETWEEN)
            packet = stand.move()
            stand.turn(packet, clock)
    return clock.spent / (rounds * AT_ONCE) / 1e9


def _said(calls: Calls, packets: list[Outgoing]) -> dict[str, Any]:
    names = [m.ALL[split_datagram(each.data)[0].message_id].msgname for each in packets]
    return {"python": calls.of, "c": calls.of_c, "packets": names}


def main() -> None:
    """Answer each line of stdin."""
    cpu(AT_ONCE)  # warm up
    print(json.dumps("ready"), flush=True)
    for line in sys.stdin:
        what, *numbers = line.split()
        if what == "calls":
            answer: Any = {"turn": counted_turn(), "wake_ups": counted_wake_ups()}
        else:
            answer = cpu(int(numbers[0]))
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
