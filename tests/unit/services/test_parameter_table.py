from math import degrees, inf, nan
from struct import pack, unpack

import pytest

from mav_tasks.errors import SettingError
from mav_tasks.services.parameter_table import PARAMETERS, Parameter, as_sent, changed, with_all
from mav_tasks.settings import Driving, Queueing, Settings

EACH = pytest.mark.parametrize("parameter", PARAMETERS.values(), ids=lambda each: each.name)


def single(value: float) -> float:
    """What a value is after its way through a PARAM_VALUE."""
    return float(unpack("<f", pack("<f", value))[0])


@EACH
def test_its_name_fits_into_a_message(parameter: Parameter) -> None:
    assert parameter.name.startswith("TSK_")
    assert len(parameter.name) <= 16
    assert parameter.name.isascii()


@EACH
def test_the_configured_value_lies_within_its_range(parameter: Parameter) -> None:
    value = parameter.value(Settings())
    assert parameter.low <= value <= parameter.high
    assert changed(Settings(), parameter.name, as_sent(single(value))) == pytest.approx(Settings())


@EACH
def test_what_was_set_is_what_is_told(parameter: Parameter) -> None:
    for value in (parameter.low, parameter.high):
        new = parameter.with_value(Settings(), as_sent(single(value)))
        assert single(parameter.value(new)) == single(value)


@EACH
@pytest.mark.parametrize("value", [nan, inf, -inf, -1.0, 1e30])
def test_a_value_out_of_range_is_refused_by_name(parameter: Parameter, value: float) -> None:
    with pytest.raises(SettingError, match=rf"{parameter.name} .*: not in .*\.\."):
        changed(Settings(), parameter.name, value)


@pytest.mark.parametrize("name", ["TSK_QUOTA", "TSK_GUIDED"])
def test_half_a_one_is_refused(name: str) -> None:
    with pytest.raises(SettingError, match=f"{name} 0.5: not "):
        changed(Settings(), name, 0.5)
    with pytest.raises(SettingError, match="not a whole number"):
        changed(Settings(), "TSK_QUOTA", 7.5)


def test_units_are_those_of_people() -> None:
    new = changed(Settings(), "TSK_TURN", 30.0)
    assert degrees(new.driving.turn_rate) == pytest.approx(30.0)
    assert changed(Settings(), "TSK_GUIDED", 1.0).guided == "now"
    assert changed(Settings(), "TSK_QUOTA", 12.0).queueing == Queueing(quota=12)


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("TSK_SPEED", 2.5, "TSK_SPEED 2.5 is more than TSK_SPEED_MAX 2"),
        ("TSK_SPEED_MAX", 0.3, "TSK_SPEED 0.5 is more than TSK_SPEED_MAX 0.3"),
        ("TSK_TURN_MAX", 20.0, "TSK_TURN 40 is more than TSK_TURN_MAX 20"),
    ],
)
def test_a_speed_never_exceeds_the_highest(name: str, value: float, says: str) -> None:
    with pytest.raises(SettingError, match=says):
        changed(Settings(), name, value)


@pytest.mark.parametrize("reverse", [False, True])
def test_kept_values_are_taken_in_whatever_order_they_allow(reverse: bool) -> None:
    values = {"TSK_SPEED": 3.0, "TSK_SPEED_MAX": 4.0}
    ordered = dict(reversed(values.items())) if reverse else values
    settings, why_not = with_all(Settings(), ordered)
    assert settings.driving == Driving(speed=3.0, max_speed=4.0)
    assert why_not == {}


def test_a_kept_value_that_is_none_any_more_is_left_out_and_named() -> None:
    values = {"TSK_GONE": 1.0, "TSK_SPEED": 100.0, "TSK_ACCEL": 0.7}
    settings, why_not = with_all(Settings(), values)
    assert settings.driving == Driving(acceleration=0.7)
    assert set(why_not) == {"TSK_GONE", "TSK_SPEED"}


@pytest.mark.parametrize("value", [0.1, 0.7, 40.0, 1e6, 0.05, 123.456])
def test_a_float32_is_read_as_the_number_that_was_meant(value: float) -> None:
    assert as_sent(single(value)) == value
