"""Outgoing seq = incoming + injected − withheld, for each source."""

import pytest

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.sequence import MOST, SequenceKeeper

ROVER = Address(1, 1)
SERVER = Address(1, 191)


def passed(words: str) -> list[int]:
    """What becomes of a rover's numbers, of one number (+) injected and one (-) withheld."""
    keeper, out = SequenceKeeper(), []
    for word in words.split():
        if word == "-":
            keeper.withheld(ROVER)
        else:
            out.append(
                keeper.injected(ROVER) if word == "+" else keeper.forwarded(ROVER, int(word))
            )
    return out


@pytest.mark.parametrize(
    ("words", "out"),
    [
        ("5 6 9 10", [5, 6, 9, 10]),  # a gap in what comes in stays a gap
        ("5 - - 8 9", [5, 6, 7]),  # what is withheld leaves none
        ("5 + + 6 8", [5, 6, 7, 8, 10]),
        ("100 + - 102 + 103", [100, 101, 102, 103, 104]),
        ("254 + + 255 0", [254, 255, 0, 1, 2]),
    ],
)
def test_what_is_injected_is_added_and_what_is_withheld_taken_off(
    words: str, out: list[int]
) -> None:
    assert passed(words) == out


def test_a_source_of_our_own_counts_from_zero() -> None:
    keeper = SequenceKeeper()
    assert [keeper.injected(SERVER) for _ in range(300)] == [n % 256 for n in range(300)]


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
