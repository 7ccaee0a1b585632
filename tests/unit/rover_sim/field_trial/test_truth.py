"""Lines of a file of true poses."""

import pytest

from rover_sim.field_trial.track import Place
from rover_sim.field_trial.truth import place_of


@pytest.mark.parametrize(
    "line",
    ["12.5,1.5,-2,0.25,0.4", '{"t": 12.5, "north": 1.5, "east": -2, "yaw": 0.25, "v": 0.4}'],
)
def test_both_forms_say_a_place_at_the_time_of_reading(line: str) -> None:
    assert place_of(line, 7.0) == Place(7.0, 1.5, -2.0, 0.25)


@pytest.mark.parametrize(
    "line", ["", "t,north,east,yaw", "1,2", '{"north": 1}', '{"north": 1, "ea']
)
def test_a_line_that_says_nothing_is_passed_over(line: str) -> None:
    assert place_of(line, 7.0) is None
