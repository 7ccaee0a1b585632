"""The parameter protocol in ArduPilot's encoding."""

import math

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


def test_reading_by_name_and_by_index() -> None:
    rig = Rig()
    rig.send(m.ParamRequestRead(1, 1, b"WP_SPEED", -1))
    (by_name,) = rig.take(m.ParamValue)
    assert (by_name.param_value, by_name.param_type) == (5.0, REAL32)
    rig.send(m.ParamRequestRead(1, 1, b"", 0))
    (by_index,) = rig.take(m.ParamValue)
    assert (by_index.param_id.rstrip("\0"), by_index.param_value) == ("SYSID_THISMAV", 1.0)


def test_an_unknown_name_gets_no_answer() -> None:
    rig = Rig()
    rig.send(m.ParamRequestRead(1, 1, b"NO_SUCH", -1), m.ParamSet(1, 1, b"NO_SUCH", 1.0, REAL32))
    assert rig.take(m.ParamValue) == []


def test_a_set_value_is_echoed_and_used() -> None:
    rig = Rig()
    rig.send(m.ParamSet(1, 1, b"WP_SPEED", 1.5, REAL32))
    assert rig.take(m.ParamValue)[0].param_value == 1.5
    rig.ready_to_drive()
    rig.run(4.0, velocity(4.0))
    assert abs(rig.truth.forward_speed - 1.5) < 0.1


def test_a_value_that_is_no_number_is_not_taken() -> None:
    rig = Rig()
    rig.send(m.ParamSet(1, 1, b"WP_SPEED", math.nan, REAL32))
    assert rig.take(m.ParamValue)[0].param_value == 5.0


def test_integers_are_cast_to_and_from_floats() -> None:
    rig = Rig()
    rig.send(m.ParamSet(1, 1, b"SYSID_MYGCS", 254.4, REAL32))
    assert rig.take(m.ParamValue)[0].param_value == 254.0
