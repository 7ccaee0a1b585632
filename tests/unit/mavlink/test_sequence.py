"""Outgoing seq = incoming + injected − withheld, for each source."""

from mav_tasks.mavlink.address import Address
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
