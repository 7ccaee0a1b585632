"""Each simulated rover through the real ones' manoeuvres: every figure near, or explained."""

import pytest

from rover_sim.compare import app
from rover_sim.compare.measuring import measure
from rover_sim.compare.pairs import PAIRS
from rover_sim.compare.verdict import Verdict, compare, missing
from tests.kit.volume import some

pytestmark = pytest.mark.timeout(180)  # s; five minutes of driving are two seconds of arithmetic


@pytest.mark.slow
def test_the_simulated_rover_is_as_unkind_as_the_real_one() -> None:
    for pair in some(PAIRS, 0, 3):
        figures = measure(pair, seed=0)  # as the command does

        differing = [
            f"{each.figure.group}: {each.figure.name}: {each.real} / {each.figure.value}"
            for each in compare(pair, figures)
            if each.verdict is Verdict.DIFFERS
        ]
        assert differing == []
        assert missing(pair, figures) == []


def test_a_rover_that_does_not_exist_is_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ending:
        app.main(["--autopilot", "px4", "--frame", "skid"])

    assert ending.value.code == 2
    assert "there is no skid rover with px4" in capsys.readouterr().err
