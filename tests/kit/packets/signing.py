"""Packets with good, bad and repeated signatures, checked without the server's code."""

from functools import partial
from hashlib import sha256
from random import Random

from mav_tasks.mavlink.signing import Key
from tests.kit.packets.battered import CALLERS, CLIENTS, UTC, Battered
from tests.kit.packets.mutants import SIGNATURE, badly_signed
from tests.kit.packets.whole import MAGIC_2, has_whole_packet

KEY = Key("soak", bytes(range(32)), "safety")
LINK_ID = 2
EPOCH = 1_420_070_400  # UTC seconds of 2015-01-01
HEADER = 10
SIGNED = 1
Stream = tuple[int, int, int]


class Signatures:
    """Creates signatures, and tracks the latest timestamp of each stream."""

    def __init__(self) -> None:
        self._time = int((UTC - EPOCH) * 1e5)
        self._latest: dict[Stream, int] = {}

    def sign(self, packet: bytes, random: Random) -> bytes:
        """Return a packet with a good signature, a late one, or one of an unknown key."""
        chance = random.random()
        if chance < 0.3:
            return badly_signed(packet, random)
        self._time += 1
        late = random.randrange(1, 1000) if chance < 0.6 else 0
        flagged = badly_signed(packet, random)[:-SIGNATURE]
        told = flagged + bytes((LINK_ID,)) + (self._time - late).to_bytes(6, "little")
        return told + sha256(KEY.secret + told).digest()[:6]

    def is_valid(self, link: str, data: bytes) -> bool:
        """Return whether these bytes of a link may change anything.

        On a stream link, earlier bytes may be processed only now, so no timestamp counts as old.
        """
        if link not in (CLIENTS, CALLERS):
            return has_whole_packet(data)
        starts = [at for at, byte in enumerate(data) if byte == MAGIC_2]
        news = list(map(partial(self._is_news, data, is_stream=link == CALLERS), starts))
        return any(news)  # every one must update the timestamps

    def _is_news(self, data: bytes, start: int, *, is_stream: bool) -> bool:
        if start + HEADER > len(data) or not data[start + 2] & SIGNED:
            return False
        packet = data[start : start + HEADER + data[start + 1] + 2 + SIGNATURE]
        if sha256(KEY.secret + packet[:-6]).digest()[:6] != packet[-6:]:
            return False
        stream = packet[-SIGNATURE], packet[5], packet[6]
        time = int.from_bytes(packet[1 - SIGNATURE : -6], "little")
        is_news = time > self._latest.get(stream, -1)
        if is_news and not is_stream:
            self._latest[stream] = time
        return is_news or is_stream


def signed_only(seed: int) -> Battered:
    """Return an engine that accepts only signed packets, with a source of all kinds of packets."""
    signatures = Signatures()
    return Battered(seed, sign=signatures.sign, is_valid=signatures.is_valid, key=KEY)
