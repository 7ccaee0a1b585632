"""A place is metres or degrees, and what may be either is asked back."""

import pytest

from mav_tasks.cli.places import parse_place
from mav_tasks.errors import UsageError
from mav_tasks.tasks.goal import GlobalPlace, LocalPlace

ZURICH = "47.3977", "8.5456"


@pytest.mark.parametrize(
    "typed",
    [
        *(ZURICH, ("47.3", "8.5"), ("-1.29", "36.82"), ("1.35", "103.8"), ("-35.36", "149.16")),
        *(("5.6037", "-0.1870"), ("0.001", "0.001"), ("60", "10")),
    ],
)
def test_what_may_be_degrees_is_asked_back(typed: tuple[str, str]) -> None:
    with pytest.raises(UsageError, match=r"latitude and longitude\? Add --global; if .* --local"):
        parse_place(*typed, is_global=False, is_local=False)
    place = parse_place(*typed, is_global=False, is_local=True)
    assert place == LocalPlace(float(typed[0]), float(typed[1]))


@pytest.mark.parametrize("typed", [("5", "3"), ("-1", "2"), ("0.5", "0.25"), ("100", "5")])
def test_metres_need_no_word_where_they_cannot_be_degrees(typed: tuple[str, str]) -> None:
    place = parse_place(*typed, is_global=False, is_local=False)
    assert place == LocalPlace(float(typed[0]), float(typed[1]))


def test_degrees_are_degrees_with_global() -> None:
    assert parse_place(*ZURICH, is_global=True, is_local=False) == GlobalPlace(473977000, 85456000)


@pytest.mark.parametrize(
    ("typed", "wrong"),
    [(("north", "1"), "NORTH|LAT 'north'"), (("91", "0"), "latitude 91"), (("0", "181"), "181")],
)
def test_what_is_no_place_is_refused(typed: tuple[str, str], wrong: str) -> None:
    with pytest.raises(UsageError) as refused:
        parse_place(*typed, is_global=True, is_local=False)
    assert wrong in str(refused.value)


def test_both_words_are_a_mistake() -> None:
    with pytest.raises(UsageError, match="choose one"):
        parse_place(*ZURICH, is_global=True, is_local=True)
