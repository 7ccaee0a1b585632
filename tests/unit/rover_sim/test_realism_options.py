"""The command line's words for how unkind a rover is, and where."""

import math

import pytest

from rover_sim.__main__ import Options, read_options
from rover_sim.geo import Origin
from rover_sim.personas import ARDUPILOT, PX4
from rover_sim.realism import (
    ARDUPILOT_ESTIMATOR,
    ARDUPILOT_REALISM,
    NO_BOOT,
    PX4_REALISM,
    Gps,
)
from rover_sim.realism_options import StickPulses
from rover_sim.vehicle import Peers


def options(line: str) -> Options:
    return read_options(line.split())


def test_a_rover_is_as_unkind_as_its_make_unless_told_otherwise() -> None:
    assert options("").realism == ARDUPILOT_REALISM
    assert options("--persona px4").realism == PX4_REALISM


def test_a_boot_can_be_asked_for_by_itself() -> None:
    assert options("--boot real").realism.boot == ARDUPILOT.boot
    assert options("--boot none").realism.boot == NO_BOOT
    assert options("--boot real --persona px4").realism.boot == PX4.boot


def test_a_metre_receiver_is_noisier() -> None:
    assert options("--gps metre").realism.estimator == ARDUPILOT_ESTIMATOR[Gps.METRE]


def test_an_origin_can_be_kept_back() -> None:
    assert not options("--origin silent").realism.tells_origin


def test_px4_answers_its_first_peer_unless_told_otherwise() -> None:
    assert options("--persona px4").peers is Peers.FIRST
    assert options("--persona px4 --peers all").peers is Peers.ALL
    assert options("--persona generic").peers is Peers.ALL
    assert options("").peers is Peers.ALL


@pytest.mark.parametrize("form", ["--home -35.4,8.5,488,90", "--home=-35.4,8.5,488,90"])
def test_it_starts_where_it_is_told_also_in_the_south(form: str) -> None:
    home = options(form).home
    assert home.origin == Origin(-35.4, 8.5, 488.0)
    assert math.degrees(home.yaw) == pytest.approx(90.0)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("--home 47,8,488", "must be LAT,LON,ALT,HEADING in numbers, not '47,8,488'"),
        ("--home a,b,c,d", "must be LAT,LON,ALT,HEADING in numbers, not 'a,b,c,d'"),
        ("--home nan,8,488,0", "must be LAT,LON,ALT,HEADING in numbers"),
        ("--home 91,8,488,0", "latitude is within 90 degrees, longitude within 180"),
        ("--sticks 99", "must be one or two pulses of 800 to 2200"),
        ("--sticks 1500,1500,1500", "must be one or two pulses of 800 to 2200"),
        ("--boot slow", "invalid choice: 'slow'"),
    ],
)
def test_what_cannot_be_is_refused(
    wrong: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        options(wrong)
    assert said in capsys.readouterr().err


def test_a_transmitter_is_held_in_microseconds() -> None:
    assert options("--sticks 1750").sticks == StickPulses(1750, 1500)
    assert options("--sticks 1500,1600").sticks == StickPulses(1500, 1600)
    assert options("").sticks is None
