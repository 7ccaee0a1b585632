"""Packets of every kind, most of them broken: nothing raises, and what is none changes nothing."""

from random import Random

import pytest

from tests.kit.bounds import Violation
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
