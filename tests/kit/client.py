"""A fake client on a memory link: plain pymavlink on its own, nothing of the server's codec.

It speaks as a stock client does: heartbeats once a second, commands repeated as MAVSDK repeats them
if asked to.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

os.environ.setdefault("MAVLINK20", "1")

from pymavlink.dialects.v20 import common

from mav_tasks.in_memory import CLIENT_LINK
from mav_tasks.links.memory import MemoryNet

Message = Any  # pymavlink's classes carry no type information

REPEATS = (0.0, 0.5, 1.0, 1.5)  # s, MAVSDK 4.1: byte-identical payload, confirmation 0, new seq
TIMEOUT = 2.0  # s, MAVSDK 4.1


@dataclass(slots=True)
class Sent:
    """A command under way."""

    message: Message
    at: float
    repeats: tuple[float, ...]
    times_sent: int = 0
    ack: Message | None = None


class FakeClient:
    """One ground station or script, with its own endpoint name."""

    def __init__(
        self,
        net: MemoryNet,
        name: str = "client",
        *,
        system_id: int = 255,
        component_id: int = 190,
        server: str = CLIENT_LINK,
    ) -> None:
        self.name = name
        self._net = net
        self._server = server
        self._link = net.link(name)
        self._mav = common.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        self._mav.robust_parsing = True
        self._next_heartbeat = net.now
        self._under_way: list[Sent] = []
        self.received: list[tuple[float, Message]] = []
        self.acks: list[Message] = []
        self.on_message: Callable[[Message], None] | None = None

    def send(self, message: Message) -> None:
        """Send one message now."""
        raw = message.pack(self._mav)
        self._mav.seq = (self._mav.seq + 1) % 256
        self._link.send(self._server, raw)

    def send_raw(self, data: bytes) -> None:
        """Send any bytes now."""
        self._link.send(self._server, data)

    def command(
        self,
        command: int,
        *params: float,
        target: tuple[int, int] = (1, 191),
        repeats: tuple[float, ...] = (0.0,),
        confirmation: int = 0,
    ) -> Sent:
        """Send a COMMAND_LONG, repeated at these times until it is acknowledged."""
        filled = (*params, *(0.0,) * (7 - len(params)))
        message = common.MAVLink_command_long_message(*target, command, confirmation, *filled)
        sent = Sent(message, self._net.now, repeats)
        self._under_way.append(sent)
        self._send_due(self._net.now)
        return sent

    def move(self, distance: float, *, priority: float = 5, nonce: int = 0, **kw: Any) -> Sent:
        """Submit TASK_MOVE."""
        return self.command(54000, distance, 0, 0, nonce, 0, 0, priority, **kw)

    def rotate(self, angle: float, *, priority: float = 5, nonce: int = 0, **kw: Any) -> Sent:
        """Submit TASK_ROTATE, degrees."""
        return self.command(54001, angle, 0, 0, nonce, 0, 0, priority, **kw)

    def stop(self, *, clear: bool = False, target: tuple[int, int] = (1, 191)) -> Sent:
        """Send TASK_STOP."""
        return self.command(54003, 1 if clear else 0, target=target)

    def proceed(self) -> Sent:
        """Send DO_PAUSE_CONTINUE(1)."""
        return self.command(193, 1)

    def pause(self) -> Sent:
        """Send DO_PAUSE_CONTINUE(0)."""
        return self.command(193, 0)

    def texts(self) -> list[str]:
        """Give the STATUSTEXTs received, as text."""
        return [m.text for _, m in self.received if m.get_type() == "STATUSTEXT"]

    def of_type(self, name: str) -> list[Message]:
        """Give the messages of one type received."""
        return [m for _, m in self.received if m.get_type() == name]

    # Party

    def next_deadline(self) -> float | None:
        due = [self._next_heartbeat]
        due += [
            sent.at + sent.repeats[sent.times_sent]
            for sent in self._under_way
            if sent.ack is None and sent.times_sent < len(sent.repeats)
        ]
        return min(due)

    def turn(self, *, now: float) -> None:
        for _, data in self._link.receive(len(self._link.arrived)):
            for message in self._mav.parse_buffer(data) or ():
                self._take(message, now)
        if now >= self._next_heartbeat:
            self._next_heartbeat = now + 1.0
            self.send(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
        self._send_due(now)

    def _take(self, message: Message, now: float) -> None:
        self.received.append((now, message))
        if message.get_type() == "COMMAND_ACK":
            self.acks.append(message)
            for sent in self._under_way:
                if sent.ack is None and sent.message.command == message.command:
                    sent.ack = message
                    break
        if self.on_message is not None:
            self.on_message(message)

    def _send_due(self, now: float) -> None:
        for sent in self._under_way:
            while (
                sent.ack is None
                and sent.times_sent < len(sent.repeats)
                and sent.at + sent.repeats[sent.times_sent] <= now
            ):
                sent.times_sent += 1
                self.send(sent.message)
        self._under_way = [s for s in self._under_way if s.ack is None]
