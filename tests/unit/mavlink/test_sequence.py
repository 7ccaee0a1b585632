"""Outgoing seq = incoming + injected − withheld, for each source."""

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.sequence import MOST, SequenceKeeper

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


def test_sources_that_somebody_makes_up_are_not_all_remembered() -> None:
    keeper = SequenceKeeper()
    ours, made_up = Address(250, 191), [Address(s, c) for s in range(1, 200) for c in range(256)]
    assert [keeper.injected(ours) for _ in range(3)] == [0, 1, 2]
    for source in made_up:
        assert keeper.forwarded(source, 7) == 7
        keeper.withheld(source)
    assert keeper.injected(ours) == 3
    assert keeper.forwarded(made_up[0], 8) == 7, "the first ones are kept"
    assert keeper.forwarded(made_up[-1], 8) == 8
    assert len(keeper._next) <= MOST + 1
    assert len(keeper._offset) <= MOST + 1


def test_nor_are_those_in_whose_name_is_sent() -> None:
    keeper = SequenceKeeper()
    for number in range(5 * MOST):
        source = Address(number % 250, number // 250)
        keeper.withheld(Address(number % 250, 100 + number // 250))
        assert keeper.injected(source) == 0
        assert keeper.injected(source) == 1
    assert max(len(keeper._next), len(keeper._offset)) <= MOST
