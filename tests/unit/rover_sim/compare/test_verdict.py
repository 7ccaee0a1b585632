"""When a simulated figure is near enough to the real one, and what an explanation covers."""

import pytest

from rover_sim.compare import explained
from rover_sim.compare.explained import Explanation
from rover_sim.compare.figure import SPEED, WORDS, Figure, Value
from rover_sim.compare.pairs import ARDUPILOT_SKID, PAIRS, PX4_ACKERMANN
from rover_sim.compare.reference import reference_of
from rover_sim.compare.report import lines
from rover_sim.compare.verdict import Verdict, compare, is_near, missing

STEADY = "Step 2 m/s", "steady speed"  # 2.047 m/s, the real one


def steady(value: Value) -> Figure:
    return Figure(*STEADY, value, SPEED)


@pytest.mark.parametrize(
    ("real", "simulated", "near"),
    [
        (1.0, 1.49, True),
        (1.0, 0.67, True),
        (1.0, 1.51, False),
        (1.0, 0.66, False),
        (-1.0, -1.2, True),
        (-1.0, 1.0, False),
        (0.01, -0.02, True),  # both under the floor
        (0.0, 0.021, False),
        (0.0, 0.0, True),
        (None, None, True),
        (None, 1.0, False),
        (1.0, None, False),
        ("HOLD", "HOLD", True),
        ("HOLD", "RTL", False),
        ("HOLD", None, False),
    ],
)
def test_near_is_a_factor_of_one_and_a_half_or_nothing_on_both_sides(
    real: Value, simulated: Value, *, near: bool
) -> None:
    assert is_near(real, simulated, floor=0.02) is near


def test_a_figure_far_off_differs_unless_it_is_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    (far,) = compare(ARDUPILOT_SKID, [steady(1.0)])
    assert far.verdict is Verdict.DIFFERS
    assert far.ratio == pytest.approx(0.4885, abs=0.001)

    slow = Explanation("ardupilot-*", "Step 2 m/s", "steady*", (0.9, 1.1), "It has a small motor.")
    monkeypatch.setattr(explained, "EXPLANATIONS", (slow,))
    (known,) = compare(ARDUPILOT_SKID, [steady(1.0)])
    assert known.verdict is Verdict.EXPLAINED
    assert known.why == "It has a small motor."


def test_an_explanation_covers_no_other_value(monkeypatch: pytest.MonkeyPatch) -> None:
    slow = Explanation("*", "*", "*", (0.9, 1.1), "It has a small motor.")
    monkeypatch.setattr(explained, "EXPLANATIONS", (slow,))

    (slower,) = compare(ARDUPILOT_SKID, [steady(0.5)])

    assert slower.verdict is Verdict.DIFFERS


def test_each_explanation_is_about_a_figure_that_there_is() -> None:
    for each in explained.EXPLANATIONS:
        assert any(
            each.is_about(pair, group, name) for pair in PAIRS for group, name in reference_of(pair)
        ), each
        assert each.why.endswith("."), each


def test_what_was_not_driven_is_told() -> None:
    absent = missing(PX4_ACKERMANN, [steady(2.0)])

    assert STEADY not in absent
    assert ("HOLD at 1 m/s", "stands after") in absent
    assert not any(group.startswith("Throttle stick") for group, _ in absent)  # ArduPilot's only


def test_the_table_shows_both_values_and_the_ratio() -> None:
    mode = Figure("HOLD at 1 m/s", "modes", "GUIDED", WORDS)
    shown = list(
        lines(ARDUPILOT_SKID, compare(ARDUPILOT_SKID, [steady(2.1), mode]), hidden=frozenset())
    )

    assert shown[2] == "Step 2 m/s"
    assert shown[3].split() == ["steady", "speed,", "m/s", "2.047", "2.100", "1.03", "ok"]
    assert shown[5].split() == ["modes", "GUIDED,", "HOLD", "GUIDED", "DIFFERS"]
    assert shown[-1] == (
        "ardupilot-skid: 2 figures, 1 within a factor of 1.5, 0 explained, 1 differ"
    )
