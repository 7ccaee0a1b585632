"""The parameter protocol in ArduPilot's encoding."""

from mav_tasks.mavlink import messages as m
from rover_sim.parameters import REAL32
from tests.unit.rover_sim.rig import Rig, velocity


def test_the_list_is_complete_and_numbered() -> None:
    rig = Rig()
    rig.send(m.ParamRequestList(1, 1))
    values = rig.take(m.ParamValue)
    assert [value.param_index for value in values] == list(range(len(values)))
    assert {value.param_count for value in values} == {len(values)}
    names = {value.param_id.rstrip("\0") for value in values}
    assert {"SYSID_THISMAV", "RC1_MIN", "COMPASS_DEV_ID", "INS_ACCOFFS_X", "WP_SPEED"} <= names


def test_a_set_value_is_echoed_and_used() -> None:
    rig = Rig()
    rig.send(m.ParamSet(1, 1, b"WP_SPEED", 1.5, REAL32))
    assert rig.take(m.ParamValue)[0].param_value == 1.5
    rig.ready_to_drive()
    rig.run(4.0, velocity(4.0))
    assert abs(rig.truth.forward_speed - 1.5) < 0.01


def test_integers_are_cast_to_and_from_floats() -> None:
    rig = Rig()
    rig.send(m.ParamSet(1, 1, b"SYSID_MYGCS", 254.4, REAL32))
    assert rig.take(m.ParamValue)[0].param_value == 254.0
