"""Packets of every kind, most of them broken: nothing raises, and what is none changes nothing."""

from random import Random
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import Outgoing
from mav_tasks.engine.packet_reader import PacketReader
from mav_tasks.mavlink.codec import Decoder
from mav_tasks.mavlink.signing import StreamTimes
from tests.kit.bounds import Violation
from tests.kit.client import setpoint
from tests.kit.packets.battered import Battered
from tests.kit.packets.mutants import Mutants, badly_signed
from tests.kit.packets.signing import signed_only
from tests.kit.packets.whole import has_whole_packet

SEED = 20261121
PACKETS = 50_000
SOME = 4_000  # enough for what is broken on purpose to show


@pytest.mark.volume
@pytest.mark.slow
@pytest.mark.timeout(240)
def test_where_signatures_are_asked_for_unsigned_forged_and_replayed_ones_do_nothing() -> None:
    battered = signed_only(SEED)
    battered.run(PACKETS // 5)
    assert battered.engine.signatures.counts.unsigned > 500
    assert battered.engine.signatures.counts.unverified > 50
    assert battered.engine.signatures.counts.old > 50


@pytest.mark.patches_core
def test_a_server_that_takes_a_packet_twice_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(StreamTimes, "is_news", lambda *_, **__: True)
    with pytest.raises(Violation, match="it is no packet, and has changed something"):
        signed_only(SEED).run(PACKETS // 5)


@pytest.mark.volume
@pytest.mark.slow
@pytest.mark.timeout(240)
def test_50000_mutated_packets_do_nothing_that_they_must_not() -> None:
    print("seed", SEED)
    battered = Battered(SEED)
    battered.run(PACKETS)
    assert sum(battered.counts.values()) == PACKETS
    assert min(battered.counts.values()) > PACKETS / 100


def test_the_same_seed_is_the_same_packets() -> None:
    ours, theirs = (Mutants(Random(3)) for _ in range(2))
    assert [ours.any() for _ in range(300)] == [theirs.any() for _ in range(300)]


def test_what_is_whole_is_known_without_the_server() -> None:
    mutants = Mutants(Random(5))
    assert all(has_whole_packet(mutants.good()) for _ in range(300))
    assert all(has_whole_packet(mutants.absurd().data) for _ in range(300))
    assert all(has_whole_packet(b"\xfd\x09" + mutants.good() + b"x") for _ in range(300))
    assert sum(has_whole_packet(mutants.broken().data) for _ in range(300)) < 60  # glued ones


# each of its rules is able to fail


@pytest.mark.patches_core
def test_a_decoder_that_looks_at_no_crc_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    decode = Decoder.decode

    def trusting(self: Decoder, packet: Any) -> Any:
        with monkeypatch.context() as patch:
            patch.setattr("mav_tasks.mavlink.codec.mcrf4xx", lambda _: _crc_of(packet))
            return decode(self, packet)

    monkeypatch.setattr(Decoder, "decode", trusting)
    with pytest.raises(Violation, match="it is no packet, and has changed something"):
        Battered(SEED).run(SOME)


@pytest.mark.patches_core
def test_an_exception_is_found_with_its_packet(monkeypatch: pytest.MonkeyPatch) -> None:
    packets = PacketReader.packets

    def brittle(self: PacketReader, item: Any, *args: Any, **kw: Any) -> Any:
        assert len(item.datagrams[0][1]) != 42, "brittle"
        return packets(self, item, *args, **kw)

    monkeypatch.setattr(PacketReader, "packets", brittle)
    with pytest.raises(Violation, match=r"AssertionError: [0-9a-f]{84}$"):
        Battered(SEED).run(SOME)


@pytest.mark.patches_core
def test_growth_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    handle = Engine.handle
    monkeypatch.setattr(Engine, "leak", [], raising=False)

    def leaking(self: Engine, item: Any, *, now: float) -> None:
        self.__dict__.setdefault("leak", []).append(now)
        handle(self, item, now=now)

    monkeypatch.setattr(Engine, "handle", leaking)
    with pytest.raises(Violation, match=r"Engine\.leak holds"):
        Battered(SEED).run(SOME)


def test_a_setpoint_to_one_that_is_not_armed_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    battered = Battered(SEED)
    mav = common.MAVLink(None, 250, 191)
    for speed, words in ((0.5, "to one not armed"), (float("nan"), "not finite")):
        outgoing = Outgoing("rovers", "stranger", setpoint(speed, system=7).pack(mav))
        with pytest.raises(Violation, match=words):
            battered._look_at(outgoing)


def test_signed_ones_may_be_made_otherwise_and_may_count_as_none() -> None:
    """The two that say what becomes of signatures, see ``tests.kit.packets.signing``."""
    made: list[bytes] = []

    def sign(packet: bytes, random: Random) -> bytes:
        made.append(badly_signed(packet, random))
        return made[-1]

    with pytest.raises(Violation, match=r"\(badly signed\): it is no packet"):
        Battered(SEED, sign=sign, is_valid=lambda _, data: data not in made and _is(data)).run(SOME)


def _is(data: bytes) -> bool:
    return has_whole_packet(data)


def _crc_of(packet: Any) -> int:
    start = 10 if packet.is_v2 else 6
    end = start + packet.raw[1]
    return int.from_bytes(packet.raw[end : end + 2], "little")
