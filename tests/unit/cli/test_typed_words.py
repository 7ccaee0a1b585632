"""What the server refuses is told in the words in which it was typed."""

import pytest

from mav_tasks.cli.typed_words import TYPED, in_typed_words, typed_words
from mav_tasks.errors import Refused
from mav_tasks.settings import KEYS

SPEED, DISTANCE = "driving.max_speed", "driving.max_distance"
RATE = "driving.max_turn_rate_deg"


@pytest.mark.parametrize(
    ("refusal", "said"),
    [
        ("param2 speed 99 not in 0.01..2", f"--speed 99: at most 2 m/s ({SPEED})"),
        ("param2 speed 0.001 not in 0.01..2", f"--speed 0.001: at least 0.01 m/s ({SPEED})"),
        ("param1 distance -20 not in -10..10", f"METRES -20: at least -10 m ({DISTANCE})"),
        ("param1 distance 1e+30 not in -10..10", f"METRES 1e+30: at most 10 m ({DISTANCE})"),
        ("item 1: param2 rate 100 not in 0.5..90", f"--rate 100: at most 90 deg/s ({RATE})"),
        (
            "item 1 is 445.0 km away, more than 100 km",
            "the place is 445.0 km away, more than 100 km",
        ),
        ("item 2: the path to it crosses the fence", "the path to it crosses the fence"),
        ("param7 priority 11 not in 0..10", "--priority 11: at most 10"),
        ("param3 phase 4 not in 0..1", None),
        ("the queue is full", None),
    ],
)
def test_a_number_out_of_range(refusal: str, said: str | None) -> None:
    assert typed_words(refusal) == said


def test_each_setting_that_is_named_is_one() -> None:
    assert {typed.setting for typed in TYPED.values() if typed.setting} <= KEYS.keys()


def test_the_reason_stays() -> None:
    with pytest.raises(Refused, match="--priority 11: at most 10") as refused, in_typed_words():
        raise Refused("param7 priority 11 not in 0..10", result=2, reason=103)
    assert (refused.value.result, refused.value.reason) == (2, 103)
