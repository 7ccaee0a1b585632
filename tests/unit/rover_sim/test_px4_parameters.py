"""The parameter protocol in PX4's encoding: an integer's bytes in the float."""

import math
from struct import pack, unpack

import pytest

from mav_tasks.mavlink import messages as m
from rover_sim.px4_parameters import Bytewise
from tests.unit.rover_sim.rig import Px4Rig

UINT32, INT32, REAL32 = 5, 6, 9


def bits(value: float) -> int:
    return int(unpack("<i", pack("<f", value))[0])


def from_bits(value: int) -> float:
    return float(unpack("<f", pack("<i", value))[0])


def read(rig: Px4Rig, name: bytes) -> m.ParamValue:
    rig.send(m.ParamRequestRead(1, 1, name, -1))
    (value,) = rig.take(m.ParamValue)
    return value


def test_the_list_is_complete_numbered_in_order_and_has_what_clients_miss() -> None:
    rig = Px4Rig()
    rig.send(m.ParamRequestList(1, 1))
    digest, *values = rig.take(m.ParamValue)
    assert digest.param_id == "_HASH_CHECK"
    assert [value.param_index for value in values] == list(range(len(values)))
    assert {value.param_count for value in values} == {len(values)}
    assert {value.param_type for value in values} == {INT32, REAL32}
    names = [value.param_id.rstrip("\0") for value in values]
    assert names == sorted(names)
    assert {
        *("SYS_AUTOSTART", "COM_RC_IN_MODE", "CAL_GYRO0_ID", "CAL_ACC0_ID", "SYS_HAS_MAG"),
        *("COM_OF_LOSS_T", "COM_OBL_RC_ACT", "MAV_SYS_ID"),
    } <= set(names)


@pytest.mark.parametrize(
    ("name", "number"),
    [(b"SYS_AUTOSTART", 50000), (b"CAL_ACC0_ID", 1310988), (b"COM_FLTMODE1", -1)],
)
def test_integers_are_read_bytewise_with_their_index(name: bytes, number: int) -> None:
    value = read(Px4Rig(), name)
    assert (bits(value.param_value), value.param_type) == (number, INT32)
    assert value.param_index < value.param_count


def test_floats_are_read_as_they_are() -> None:
    value = read(Px4Rig(), b"COM_OF_LOSS_T")
    assert (value.param_value, value.param_type) == (1.0, REAL32)


@pytest.mark.parametrize("number", [5, -1, 0, 2**31 - 1, -(2**31)])
def test_a_set_integer_is_echoed_and_kept_whatever_it_is(number: int) -> None:
    rig = Px4Rig()
    rig.send(m.ParamSet(1, 1, b"COM_OBL_RC_ACT", from_bits(number), INT32))
    (echo,) = rig.take(m.ParamValue)
    assert bits(echo.param_value) == number
    assert rig.autopilot.parameters["COM_OBL_RC_ACT"] == number


def test_a_set_float_is_echoed_unclamped_but_must_be_a_number() -> None:
    rig = Px4Rig()
    rig.send(m.ParamSet(1, 1, b"COM_OF_LOSS_T", -7.5, REAL32))
    assert rig.take(m.ParamValue)[0].param_value == -7.5
    rig.send(m.ParamSet(1, 1, b"COM_OF_LOSS_T", math.nan, REAL32))
    assert rig.autopilot.parameters["COM_OF_LOSS_T"] == -7.5


def test_the_hash_changes_with_a_value() -> None:
    rig = Px4Rig()
    before = read(rig, b"_HASH_CHECK")
    assert (before.param_type, before.param_index) == (UINT32, 65535)
    assert bits(read(rig, b"_HASH_CHECK").param_value) == bits(before.param_value)
    rig.autopilot.parameters["NAV_ACC_RAD"] = 1.0
    assert bits(read(rig, b"_HASH_CHECK").param_value) != bits(before.param_value)


def test_the_system_id_is_shown() -> None:
    assert bits(read(Px4Rig(), b"MAV_SYS_ID").param_value) == 1


def test_unsigned_values_fit() -> None:
    assert bits(Bytewise().to_wire(0x80000001, UINT32)) & 0xFFFFFFFF == 0x80000001
