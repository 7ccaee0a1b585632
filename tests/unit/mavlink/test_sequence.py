"""Outgoing seq = incoming + injected − withheld, for each source."""

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.sequence import SequenceKeeper

ROVER = Address(1, 1)
SERVER = Address(1, 191)


def test_a_gap_in_what_comes_in_stays_a_gap() -> None:
    keeper = SequenceKeeper()
    assert [keeper.forwarded(ROVER, seq) for seq in (5, 6, 9, 10)] == [5, 6, 9, 10]


def test_what_is_withheld_leaves_no_gap() -> None:
    keeper = SequenceKeeper()
    out = [keeper.forwarded(ROVER, 5)]
    keeper.withheld(ROVER)  # 6
    keeper.withheld(ROVER)  # 7
    out += [keeper.forwarded(ROVER, 8), keeper.forwarded(ROVER, 9)]
    assert out == [5, 6, 7]


def test_what_is_injected_takes_the_next_number() -> None:
    keeper = SequenceKeeper()
    out = [keeper.forwarded(ROVER, 5), keeper.injected(ROVER), keeper.injected(ROVER)]
    out += [keeper.forwarded(ROVER, 6), keeper.forwarded(ROVER, 8)]
    assert out == [5, 6, 7, 8, 10]


def test_withholding_and_injecting_add_up() -> None:
    keeper = SequenceKeeper()
    out = [keeper.forwarded(ROVER, 100), keeper.injected(ROVER)]
    keeper.withheld(ROVER)  # 101
    out += [keeper.forwarded(ROVER, 102), keeper.injected(ROVER), keeper.forwarded(ROVER, 103)]
    assert out == [100, 101, 102, 103, 104]


def test_numbers_wrap_at_256() -> None:
    keeper = SequenceKeeper()
    out = [keeper.forwarded(ROVER, 254), keeper.injected(ROVER), keeper.injected(ROVER)]
    out += [keeper.forwarded(ROVER, 255), keeper.forwarded(ROVER, 0)]
    assert out == [254, 255, 0, 1, 2]


def test_a_source_of_our_own_counts_from_zero() -> None:
    keeper = SequenceKeeper()
    assert [keeper.injected(SERVER) for _ in range(300)] == [n % 256 for n in range(300)]


def test_sources_are_numbered_apart() -> None:
    keeper = SequenceKeeper()
    keeper.injected(SERVER)
    keeper.withheld(SERVER)
    assert [keeper.forwarded(ROVER, 9), keeper.injected(SERVER)] == [9, 1]
