"""The settings that a client can change while the server runs, as parameters of MAVLink."""

from math import degrees, inf, nan
from struct import pack, unpack

import pytest

from mav_tasks.basics.errors import SettingError
from mav_tasks.config.parameter_table import PARAMETERS, as_sent, changed, with_all
from mav_tasks.config.settings import Driving, Queueing, Settings


def single(value: float) -> float:
    """What a value is after its way through a PARAM_VALUE."""
    return float(unpack("<f", pack("<f", value))[0])


def test_each_has_a_name_that_fits_and_takes_what_lies_within_its_range() -> None:
    for name, parameter in PARAMETERS.items():
        assert parameter.name == name
        assert name.startswith("TSK_")
        assert name.isascii()
        assert len(name) <= 16
        value = parameter.value(Settings())
        assert parameter.low <= value <= parameter.high, name
        assert changed(Settings(), name, as_sent(single(value))) == pytest.approx(Settings())
        for end in (parameter.low, parameter.high):
            new = parameter.with_value(Settings(), as_sent(single(end)))
            assert single(parameter.value(new)) == single(end), name
    assert as_sent(1e39) == 1e39


@pytest.mark.parametrize("value", [nan, inf, -inf, -1.0, 1e30])
def test_a_value_out_of_range_is_refused_by_name(value: float) -> None:
    for name in PARAMETERS:
        with pytest.raises(SettingError, match=rf"{name} .*: not in .*\.\."):
            changed(Settings(), name, value)


def test_units_are_those_of_people_and_a_float32_is_read_as_the_number_that_was_meant() -> None:
    new = changed(Settings(), "TSK_TURN", 30.0)
    assert degrees(new.driving.turn_rate) == pytest.approx(30.0)
    assert changed(Settings(), "TSK_GUIDED", 1.0).guided == "now"
    assert changed(Settings(), "TSK_QUOTA", 12.0).queueing == Queueing(quota=12)
    values = (0.1, 0.7, 40.0, 1e6, 0.05, 123.456)
    assert tuple(as_sent(single(value)) for value in values) == values


def test_what_is_refused_is_said_by_name() -> None:
    for name, value, says in (
        ("TSK_GUIDED", 0.5, "TSK_GUIDED 0.5: not "),
        ("TSK_QUOTA", 7.5, "not a whole number"),
        ("TSK_SPEED", 2.5, "TSK_SPEED 2.5 is more than TSK_SPEED_MAX 2"),
        ("TSK_SPEED_MAX", 0.3, "TSK_SPEED 0.5 is more than TSK_SPEED_MAX 0.3"),
        ("TSK_TURN_MAX", 20.0, "TSK_TURN 40 is more than TSK_TURN_MAX 20"),
    ):
        with pytest.raises(SettingError, match=says):
            changed(Settings(), name, value)


def test_kept_values_are_taken_in_whatever_order_they_allow_and_others_are_named() -> None:
    values = {"TSK_SPEED": 3.0, "TSK_SPEED_MAX": 4.0}
    for ordered in (values, dict(reversed(values.items()))):
        settings, why_not = with_all(Settings(), ordered)
        assert (settings.driving, why_not) == (Driving(speed=3.0, max_speed=4.0), {})
    values = {"TSK_GONE": 1.0, "TSK_SPEED": 100.0, "TSK_ACCEL": 0.7}
    settings, why_not = with_all(Settings(), values)
    assert settings.driving == Driving(acceleration=0.7)
    assert set(why_not) == {"TSK_GONE", "TSK_SPEED"}
