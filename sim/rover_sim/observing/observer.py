"""One end of a link that hears one autopilot and asks it things. It judges nothing.

The client library's ``LinkDriver`` moves the packets; pymavlink reads and writes the messages, so
that a mistake in our own codec cannot be made at both ends. Runs in real and in virtual time.
"""

import asyncio
from collections.abc import Callable, Iterator
from itertools import repeat
from math import inf
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import development as mav

from mav_tasks.client.link_driver import LinkDriver
from mav_tasks.links.base import Link
from mav_tasks.mavlink.packet import Packet

AUTOPILOT = 1  # component
STATION = (255, 190)
NO_VEHICLES = frozenset({6, 18, 26, 27})  # MAV_TYPE: ground station, computer, gimbal, ADS-B
BEAT = 1.0  # s between heartbeats
PATIENCE = 1.0  # s for the answer to a command
LOOK = 0.02  # s between two looks at a condition
STICK_PERIOD = 0.1  # s between two RC_CHANNELS_OVERRIDE; each is valid for 3 s
LET_GO = (1500,) * 5 + (0,)  # µs: neutral before the release, or the last value lasts for 3 s
UNTOUCHED = 65535


class Heard(NamedTuple):
    """A message with the time at which it came, and its packet."""

    at: float
    name: str  # "UNKNOWN_54000" of one that pymavlink does not know
    message: Any  # pymavlink's; None of one that it does not know
    packet: Packet


class Answer(NamedTuple):
    """A command, and the answer to it."""

    command: int
    params: tuple[float, ...]
    asked_at: float
    result: int | None  # MAV_RESULT; None: no answer
    took: float  # s
    extra: int = 0  # result_param2

    @property
    def is_accepted(self) -> bool:
        """Whether the command was accepted."""
        return self.result == 0

    @property
    def is_refused(self) -> bool:
        """Whether it was refused with a result that every client knows."""
        return self.result in (1, 2, 3, 4)

    def __str__(self) -> str:
        if self.result is None:
            return f"no answer within {PATIENCE:g} s"
        known = mav.enums["MAV_RESULT"].get(self.result)
        name = f"result {self.result}" if known is None else known.name.removeprefix("MAV_RESULT_")
        return f"{name} after {self.took:.2f} s"


async def until(condition: Callable[[], object], within: float) -> bool:
    """Wait for a condition; return whether it held in time."""
    now = asyncio.get_running_loop().time
    end = now() + within
    while not condition():
        if now() >= end:
            return False
        await asyncio.sleep(LOOK)
    return True


class Observer:
    """Implements ``Talk`` of the link driver, for the first autopilot that it hears."""

    def __init__(self, link: Link, *, keeps: bool = False) -> None:
        """``keeps``: remember every message in ``log``, not only the last of each kind."""
        self.out: Any = mav.MAVLink(self, *STATION)
        self.system = 0  # of the first autopilot that was heard
        self.last: dict[str, Heard] = {}
        self.log: list[Heard] = []
        self.answers: list[Answer] = []
        #: called with each message of the autopilot's system
        self.listeners: list[Callable[[Heard], None]] = []
        self._keeps = keeps
        self._waiting: list[tuple[list[str], Callable[[Any], object], asyncio.Future[Any]]] = []
        self._pulses: Iterator[int] = iter(())
        self._beat_at, self._stick_at = 0.0, inf
        self._link = LinkDriver(link, self, signatures=None)
        self._link.begin()

    def __repr__(self) -> str:
        return f"Observer(system {self.system}, {len(self.last)} kinds)"

    @property
    def now(self) -> float:
        """The loop's time, s."""
        return self._link.now

    def message(self, name: str) -> Any:
        """Return the last message of this name, or None."""
        heard = self.last.get(name)
        return None if heard is None else heard.message

    def silence(self, name: str) -> float:
        """Return the seconds since the last message of this name."""
        return self.now - self.last[name].at if name in self.last else inf

    # asking

    async def command(self, number: int, *params: float, component: int = AUTOPILOT) -> Answer:
        """Send a COMMAND_LONG, by default to the autopilot, and return its answer."""
        filled, began = (*params, *(0.0,) * (7 - len(params))), self.now
        self.out.command_long_send(self.system, component, number, 0, *filled)
        ack = await self.wait("COMMAND_ACK", PATIENCE, lambda ack: ack.command == number)
        seen = (None, 0) if ack is None else (int(ack.result), int(ack.result_param2))
        self.answers.append(Answer(number, filled, began, seen[0], self.now - began, seen[1]))
        return self.answers[-1]

    async def wait(
        self, names: str, within: float, fits: Callable[[Any], object] = lambda _: True
    ) -> Any:
        """Return the next message with one of the names that fits, or None in time."""
        future: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        self._waiting.append((names.split(), fits, future))
        try:
            return await asyncio.wait_for(future, within)
        except TimeoutError:
            return None
        finally:
            self._waiting = [each for each in self._waiting if each[2] is not future]

    async def found(self, within: float) -> bool:
        """Wait for the first heartbeat of an autopilot; return whether it came in time."""
        return "HEARTBEAT" in self.last or await self.wait("HEARTBEAT", within) is not None

    def push_stick(self, throttle: int | None) -> None:
        """Hold the throttle at a pulse (µs) by RC_CHANNELS_OVERRIDE; None releases it."""
        self._pulses = iter(LET_GO) if throttle is None else repeat(throttle)
        self._stick_at = self.now
        self._link.turn()

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    # as pymavlink's file, and as the link driver's Talk

    def write(self, data: bytes) -> None:
        """Send the bytes of one packet."""
        self._link.send(bytes(data))

    def receive(self, packet: Packet, *, now: float) -> None:
        """Read a packet, and remember it if it is the autopilot's."""
        name, message = f"UNKNOWN_{packet.message_id}", None
        if packet.message_id in mav.mavlink_map:
            try:
                message = self.out.decode(bytearray(packet.raw))
            except mav.MAVError:
                return
            name = str(message.get_type())
        self._take(Heard(now, name, message, packet))

    def next_deadline(self) -> float:
        """Return when to send next by itself."""
        return min(self._beat_at, self._stick_at)

    def handle_deadline(self, *, now: float) -> None:
        """Send the heartbeat and the stick's position when they are due."""
        if now >= self._beat_at:
            self._beat_at = now + BEAT
            self.out.heartbeat_send(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 4)
        if now >= self._stick_at:
            pulse = next(self._pulses, None)
            self._stick_at = inf if pulse is None else now + STICK_PERIOD
            if pulse is not None:
                channels = (UNTOUCHED, UNTOUCHED, pulse, *(UNTOUCHED,) * 5)
                self.out.rc_channels_override_send(self.system, AUTOPILOT, *channels)

    def take_packets(self) -> list[bytes]:
        """Return nothing: each message is sent at once."""
        return []

    def _take(self, heard: Heard) -> None:
        name, source = heard.name, heard.packet.source
        is_autopilot = source.component_id == AUTOPILOT
        is_station = name == "HEARTBEAT" and heard.message.type in NO_VEHICLES
        if not self.system and is_autopilot and not is_station:
            self.system = source.system_id
        if source.system_id != self.system:
            return
        for listener in self.listeners:
            listener(heard)
        if not (is_autopilot or name == "COMMAND_ACK"):
            return
        self.last[name] = heard
        if self._keeps:
            self.log.append(heard)
        for wanted, fits, future in self._waiting:
            if name in wanted and not future.done() and fits(heard.message):
                future.set_result(heard.message)
