"""Numbers of 30 bits in a float32, as C and pymavlink would read and write them."""

from struct import pack, unpack

from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.mavlink.float_param import EXACT, LARGEST, large_number, to_param


def on_the_wire(value: float) -> float:
    """Return what arrives of a parameter."""
    arrived: float = unpack("<f", pack("<f", value))[0]
    return arrived


@given(st.integers(EXACT + 1, LARGEST))
def test_a_large_number_arrives_bit_for_bit(number: int) -> None:
    value = on_the_wire(to_param(number))
    assert -1.0 < value < 0.0
    assert large_number(value) == number
    assert unpack("<I", pack("<f", value))[0] == number | 0x80000000


@given(st.integers(0, EXACT))
def test_a_small_number_is_itself(number: int) -> None:
    value = on_the_wire(to_param(number))
    assert value == number
    assert large_number(value) is None


def test_what_is_no_large_number_is_none_and_what_is_out_of_range_stays_so() -> None:
    for value in (-0.0, -1.0, -2.0, 0.5, 1e9, float("nan"), float("-inf"), -1e-40):
        assert large_number(value) is None
    for number in (-1, LARGEST + 1, 2**40):
        assert to_param(number) == number
