"""Setting a rover's loss failsafe, so that it stands when setpoints stop."""

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.probe.failsafe import NotSet
from mav_tasks.probe.probe import Options
from rover_sim.personas import ARDUPILOT, GENERIC, PX4, Persona
from tests.kit.probing import ProbeWorld

BY_DEFAULT: dict[str, float] = {
    "COM_OBL_RC_ACT": 0,
    "NAV_RCL_ACT": 2,
    "COM_OF_LOSS_T": 1.0,
    "NAV_DLL_ACT": 0,
}
STANDS = "stops when setpoints stop: Hold"


def mended(parameters: dict[str, float], persona: Persona = PX4) -> ProbeWorld:
    world = ProbeWorld(persona=persona, options=Options(set_failsafe=True))
    for name, value in parameters.items():
        world.rover.autopilot.parameters[name] = value
    world.finish()
    return world


def written(world: ProbeWorld) -> list[str]:
    sent = [each for _, each in world.party.sent if isinstance(each, m.ParamSet)]
    return [str(each.param_id).rstrip("\0") for each in sent]


@pytest.mark.parametrize("persona", [PX4, GENERIC], ids=lambda p: p.name)
def test_one_as_it_leaves_the_factory_stands_from_then_on(persona: Persona) -> None:
    world = mended(BY_DEFAULT, persona)
    assert world.probe.error is None
    assert world.probe.findings.failsafe_set == "COM_OBL_RC_ACT 0, now 5"
    assert world.probe.findings.loss_by_parameters == STANDS
    assert world.rover.autopilot.parameters["COM_OBL_RC_ACT"] == 5


def test_only_what_is_wrong_is_changed() -> None:
    world = mended(BY_DEFAULT | {"COM_OBL_RC_ACT": 7, "COM_OF_LOSS_T": 60, "NAV_DLL_ACT": 2})
    assert written(world) == ["COM_OF_LOSS_T", "NAV_DLL_ACT"]
    assert world.probe.findings.loss_by_parameters == "stops when setpoints stop: motors off"
    again = mended(BY_DEFAULT | {"COM_OBL_RC_ACT": 5})
    assert (written(again), again.probe.findings.failsafe_set) == ([], "nothing to change")


def test_nothing_else_is_changed_and_nothing_is_moved() -> None:
    world = mended(BY_DEFAULT)
    assert written(world) == ["COM_OBL_RC_ACT"]
    assert world.setpoints() == []
    assert not world.rover.autopilot.armed


def test_one_that_stops_by_its_make_has_nothing_to_set() -> None:
    world = mended({}, ARDUPILOT)
    assert (written(world), world.probe.findings.failsafe_set) == ([], "nothing to set")
    assert world.probe.findings.loss_by_parameters.startswith(
        "stops 3 s after the last setpoint, as ArduPilot does"
    )


def test_one_that_does_not_take_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rover_sim.px4_parameters.Bytewise.from_wire", lambda *_: None)
    world = mended(BY_DEFAULT)
    assert isinstance(world.probe.error, NotSet)
    assert str(world.probe.error) == "the rover does not accept COM_OBL_RC_ACT 5"
