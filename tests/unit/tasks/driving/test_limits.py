from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.settings import Driving
from mav_tasks.tasks.driving.guidance import ZERO, Velocity
from mav_tasks.tasks.driving.limits import limited, safe_braking

DRIVING = Driving(acceleration=0.5, turn_acceleration=2.0, max_speed=2.0, max_turn_rate=1.5)
TICK = 0.05  # s


def out(wish: Velocity, last: Velocity = ZERO, *, elapsed: float = TICK) -> Velocity:
    return limited(wish, last, driving=DRIVING, elapsed=elapsed)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_speeding_up_is_ramped_to_the_wish(sign: float) -> None:
    last, speeds = ZERO, []
    for _ in range(6):
        last = out(Velocity(sign * 0.1, 0.0), last)
        speeds.append(round(last.forward, 6))
    assert speeds == [sign * v for v in (0.025, 0.05, 0.075, 0.1, 0.1, 0.1)]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_turning_is_ramped_too(sign: float) -> None:
    assert out(Velocity(0.5, sign * 1.0)) == Velocity(0.025, sign * 0.1)


def test_slowing_down_is_not_ramped() -> None:
    assert out(Velocity(0.1, 0.05), Velocity(2.0, 1.5)) == Velocity(0.1, 0.05)


def test_zero_passes_at_once() -> None:
    assert out(ZERO, Velocity(2.0, 1.5)) == ZERO


def test_reversing_begins_from_zero() -> None:
    assert out(Velocity(-1.0, 0.0), Velocity(1.0, 0.0)) == Velocity(-0.025, 0.0)


@pytest.mark.parametrize("wish", [Velocity(nan, 0.1), Velocity(0.5, nan), Velocity(inf, -inf)])
def test_what_is_not_finite_becomes_a_stop(wish: Velocity) -> None:
    assert out(wish, Velocity(1.0, 1.0)) == ZERO


def test_nothing_is_faster_than_allowed() -> None:
    assert out(Velocity(9.0, -9.0), Velocity(2.0, -1.5), elapsed=10.0) == Velocity(2.0, -1.5)


speeds = st.floats(allow_nan=True, allow_infinity=True)


@given(speeds, speeds, st.floats(-2, 2), st.floats(-1.5, 1.5), st.floats(0, 0.1))
def test_no_wish_makes_a_jump(
    forward: float, yaw_rate: float, last: float, last_rate: float, elapsed: float
) -> None:
    sent = out(Velocity(forward, yaw_rate), Velocity(last, last_rate), elapsed=elapsed)
    assert abs(sent.forward) <= max(abs(last), DRIVING.acceleration * elapsed + abs(last))
    assert abs(sent.forward) <= DRIVING.max_speed
    assert abs(sent.yaw_rate) <= DRIVING.max_turn_rate


@pytest.mark.parametrize(
    ("speed", "distance", "planned"),
    [
        (0.3, 0.0, 0.5),
        (0.3, 0.18, 0.5),  # 0.3 s of lag and 0.5 m/s²: as planned
        (0.3, 0.19, 0.3**2 / (2 * 0.19)),
        (1.0, 4.0, 0.125),
    ],
)
def test_a_measured_stop_makes_more_careful_and_never_less(
    speed: float, distance: float, planned: float
) -> None:
    assert safe_braking(DRIVING, speed, distance) == pytest.approx(planned)
