"""Outgoing seq = incoming + injected − withheld, for each source."""

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.number_line import NumberLine
from mav_tasks.mavlink.sequence import MOST, SequenceKeeper


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


def test_nor_are_those_in_whose_name_is_sent() -> None:
    keeper = SequenceKeeper()
    sources = [Address(number % 250, number // 250) for number in range(5 * MOST)]
    for source in sources:
        assert [keeper.injected(source) for _ in range(2)] == [0, 1]
    assert [keeper.injected(source) for source in sources[:MOST]] == [0] * MOST, "forgotten"


def test_a_source_that_begins_anew_goes_on_after_what_has_passed() -> None:
    keeper, source = SequenceKeeper(), Address(1, 1)
    numbers = []
    for begins in (9, 0):
        keeper.continued(source, begins)
        numbers.append(keeper.forwarded(source, begins))
    assert numbers == [9, 10]


def test_a_packet_left_after_the_one_before_it_came_if_that_came() -> None:
    line = NumberLine()
    assert [line.place(seq, now=float(seq)) for seq in (5, 9)] == [5, 9]
    assert [line.sent_after(number, now=10.0) for number in (3, 7, 9)] == [0.0, 5.0, 10.0]
    assert not line.has_all(9, within=1.0)
