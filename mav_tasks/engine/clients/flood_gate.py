"""Limits the datagrams that are parsed: a rate for each client, one for all strangers together.

It decides by sender and size alone, before parsing, which costs more. From datagrams above the
limit only STOP packets are let in.
"""

import re
from collections.abc import Callable
from itertools import islice, repeat

from mav_tasks.engine.inputs import LinkChanged, LinkSide, Packets, Peer
from mav_tasks.latest import keep_latest
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.packet import CRC, HEADER_V1, HEADER_V2, MAGIC_V2, SIGNATURE_LENGTH, SIGNED
from mav_tasks.services.token_bucket import TokenBucket
from mav_tasks.settings import Clients

_NUMBER = re.escape(int(MavCmd.TASK_STOP).to_bytes(2, "little"))
#: the start of a STOP, MAVLink 1 or 2: COMMAND_INT or COMMAND_LONG, with its command number
_STOP = re.compile(
    rb"\xfe.{4}[\x4b\x4c].{28}" + _NUMBER + rb"|\xfd.{6}[\x4b\x4c]\0\0.{28}" + _NUMBER, re.DOTALL
)
STRANGERS = 500.0  # datagrams a second, of all senders together that are no clients
MOST_BUCKETS = 1024
MOST_STOPS = 16  # from one datagram: routers put several packets into one
WITHIN = 1.0  # s, whose datagrams may come in one burst
SIZE = 64  # each so many bytes count as one more datagram, as many packets may be in one


class FloodGates:
    """The gates of all datagram links of clients."""

    def __init__(self, *, is_client: Callable[[str, Peer], bool], settings: Clients) -> None:
        self._is_client = is_client
        self._rate = settings.packet_rate
        self._gates: dict[str, FloodGate] = {}

    def __repr__(self) -> str:
        return f"FloodGates({self._gates})"

    @property
    def left_out(self) -> int:
        """Count of dropped datagrams."""
        return sum(gate.left_out for gate in self._gates.values())

    def apply(self, settings: Clients) -> None:
        self._rate = settings.packet_rate
        for gate in self._gates.values():
            gate.apply(rate=self._rate)

    def change_link(self, change: LinkChanged) -> None:
        """Add or remove the gate of a link. Stream links need none: they have backpressure."""
        link = change.link
        self._gates.pop(link, None)
        if change.up and change.side is LinkSide.CLIENTS and not change.is_stream:
            self._gates[link] = FloodGate(
                rate=self._rate, is_known=lambda peer: self._is_client(link, peer)
            )

    def let_in(self, item: Packets, *, now: float) -> Packets:
        """Return the datagrams within the limit, and the STOPs of the others."""
        gate = self._gates.get(item.link)
        return item if gate is None else gate.let_in(item, now=now)


def stops_in(data: bytes) -> bytes:
    """Return the joined parts of a datagram that look like STOP packets, or b""."""
    found = islice(_STOP.finditer(data), MOST_STOPS)
    return b"".join(_packet_at(data, each.start()) for each in found)


def _packet_at(data: bytes, start: int) -> bytes:
    packet = data[start:]
    if packet[0] == MAGIC_V2:
        is_signed = packet[2] & SIGNED
        return packet[: packet[1] + HEADER_V2 + CRC + (SIGNATURE_LENGTH if is_signed else 0)]
    return packet[: packet[1] + HEADER_V1 + CRC]


class FloodGate:
    """The gate of one datagram link."""

    def __init__(self, *, rate: float, is_known: Callable[[Peer], bool]) -> None:
        self._rate = rate
        self._is_known = is_known
        self._buckets: dict[Peer, TokenBucket] = {}
        self._strangers: TokenBucket | None = None
        #: count of dropped datagrams
        self.left_out = 0

    def __repr__(self) -> str:
        return f"FloodGate({len(self._buckets)} clients, {self.left_out} left out)"

    def apply(self, *, rate: float) -> None:
        """Take a new rate for each client, in datagrams a second."""
        self._rate = rate
        self._buckets.clear()

    def let_in(self, item: Packets, *, now: float) -> Packets:
        """Return the datagrams within the limit, and the STOPs of the others."""
        buckets = self._buckets
        let_in: list[tuple[Peer, bytes]] = []
        times: list[float] = []
        is_whole = True
        for each, arrived in zip(item.datagrams, item.arrived or repeat(now), strict=False):
            bucket = buckets.get(each[0])
            if bucket is None:
                bucket = self._bucket_of(each[0], now=now)
            peer, data = each
            if not bucket.take(tokens=1 + len(data) // SIZE, now=now):
                is_whole = False
                if not (stops := stops_in(data)):
                    continue
                each = peer, stops
            let_in.append(each)
            times.append(arrived)
        self.left_out += len(item.datagrams) - len(let_in)
        return item if is_whole else Packets(item.link, let_in, times)

    def _bucket_of(self, peer: Peer, *, now: float) -> TokenBucket:
        if not self._is_known(peer):
            if self._strangers is None:
                self._strangers = TokenBucket(rate=STRANGERS, burst=STRANGERS, now=now)
            return self._strangers
        bucket = TokenBucket(rate=self._rate, burst=self._rate * WITHIN, now=now)
        keep_latest(self._buckets, peer, bucket, most=MOST_BUCKETS)
        return bucket
