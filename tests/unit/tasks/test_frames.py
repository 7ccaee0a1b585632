"""Places on earth and in the local frame: one mapping, both ways."""

from math import cos, hypot, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.kinds import GlobalPlace, LocalPlace
from mav_tasks.tasks.driving.frames import to_global, to_local

RESOLUTION = 0.0112  # m, of the integers

origins = st.builds(
    GlobalPlace, st.integers(-800_000_000, 800_000_000), st.integers(-1_800_000_000, 1_799_999_999)
)
near = st.builds(LocalPlace, st.floats(-10_000, 10_000), st.floats(-10_000, 10_000))


def apart(one: LocalPlace, other: LocalPlace) -> float:
    return hypot(one.north - other.north, one.east - other.east)


def test_it_is_the_autopilots_own_mapping() -> None:
    origin = GlobalPlace(-353_632_620, 1_491_652_370)
    place = GlobalPlace(-352_732_620, 1_492_752_370)
    mean = radians((-35.3632620 - 35.2732620) / 2)
    metres = 111_318.84502145034
    local = to_local(place, origin)
    assert local.north == pytest.approx(0.09 * metres, abs=1e-3)
    assert local.east == pytest.approx(0.11 * metres * cos(mean), abs=1e-3)


@given(origins, near)
def test_there_and_back_is_the_same_place_but_for_what_integers_resolve(
    origin: GlobalPlace, local: LocalPlace
) -> None:
    assert apart(to_local(to_global(local, origin), origin), local) <= RESOLUTION


@given(origins, near)
def test_what_an_integer_names_is_exact_to_a_millimetre(
    origin: GlobalPlace, local: LocalPlace
) -> None:
    place = to_global(local, origin)
    again = to_global(to_local(place, origin), origin)
    assert again == place
    assert apart(to_local(again, origin), to_local(place, origin)) < 1e-3


def test_across_the_date_line_it_is_not_far() -> None:
    west, east = GlobalPlace(0, -1_799_999_000), GlobalPlace(0, 1_799_999_000)
    assert to_local(west, east).east == pytest.approx(2_000 * 0.011131884502, abs=1e-3)
    assert to_local(east, west).east == pytest.approx(-2_000 * 0.011131884502, abs=1e-3)


def test_what_rounds_to_the_date_line_has_one_name() -> None:
    origin = GlobalPlace(0, 1_799_999_999)
    assert to_global(LocalPlace(0.0, 0.0078125), origin) == GlobalPlace(0, -1_800_000_000)
