"""The parameter protocol in PX4's encoding: an integer's bytes in the float."""

from struct import pack, unpack

from mav_tasks.mavlink import messages as m
from tests.unit.rover_sim.rig import Px4Rig, Rig

UINT32, INT32, REAL32 = 5, 6, 9


def bits(value: float) -> int:
    return int(unpack("<i", pack("<f", value))[0])


def from_bits(value: int) -> float:
    return float(unpack("<f", pack("<i", value))[0])


def read(rig: Rig, name: bytes) -> m.ParamValue:
    rig.send(m.ParamRequestRead(1, 1, name, -1))
    (value,) = rig.take(m.ParamValue)
    return value


def test_integers_are_read_bytewise_with_their_index() -> None:
    for name, number in [
        (b"SYS_AUTOSTART", 50000),
        (b"CAL_ACC0_ID", 1310988),
        (b"COM_FLTMODE1", -1),
    ]:
        value = read(Px4Rig(), name)
        assert (bits(value.param_value), value.param_type) == (number, INT32)
        assert value.param_index < value.param_count


def test_a_set_integer_is_echoed_and_kept_whatever_it_is() -> None:
    for number in [5, -1, 0, 2**31 - 1, -(2**31)]:
        rig = Px4Rig()
        rig.send(m.ParamSet(1, 1, b"COM_OBL_RC_ACT", from_bits(number), INT32))
        (echo,) = rig.take(m.ParamValue)
        assert bits(echo.param_value) == number
        assert rig.autopilot.parameters["COM_OBL_RC_ACT"] == number
