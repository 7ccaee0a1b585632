from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.config.settings import Driving
from mav_tasks.kinds.guidance import ZERO, Velocity
from mav_tasks.tasks.driving.bounds import limited, safe_braking

DRIVING = Driving(acceleration=0.5, turn_acceleration=2.0, max_speed=2.0, max_turn_rate=1.5)
TICK = 0.05  # s
FAST = Velocity(2.0, 1.5)


def out(wish: Velocity, last: Velocity = ZERO, *, elapsed: float = TICK) -> Velocity:
    return limited(wish, last, driving=DRIVING, elapsed=elapsed)


def test_what_is_asked_for_is_ramped_up_and_never_down() -> None:
    for sign in (1.0, -1.0):
        last, speeds = ZERO, []
        for _ in range(6):
            last = out(Velocity(sign * 0.1, 0.0), last)
            speeds.append(round(last.forward, 6))
        assert speeds == [sign * v for v in (0.025, 0.05, 0.075, 0.1, 0.1, 0.1)]
        assert out(Velocity(0.5, sign * 1.0)) == Velocity(0.025, sign * 0.1)
    assert out(Velocity(0.1, 0.05), FAST) == Velocity(0.1, 0.05)
    assert out(ZERO, FAST) == ZERO
    assert out(Velocity(-1.0, 0.0), Velocity(1.0, 0.0)) == Velocity(-0.025, 0.0)
    assert out(Velocity(9.0, -9.0), Velocity(2.0, -1.5), elapsed=10.0) == Velocity(2.0, -1.5)


def test_what_is_not_finite_becomes_a_stop() -> None:
    for wish in (
        Velocity(nan, 0.1),
        Velocity(0.5, nan),
        Velocity(inf, -inf),
        Velocity(0.5, 0.0, nan),
    ):
        assert out(wish, FAST) == ZERO


speeds = st.floats(allow_nan=True, allow_infinity=True)


@given(speeds, speeds, st.floats(-2, 2), st.floats(-1.5, 1.5), st.floats(0, 0.1))
def test_no_wish_makes_a_jump(
    forward: float, yaw_rate: float, last: float, last_rate: float, elapsed: float
) -> None:
    sent = out(Velocity(forward, yaw_rate), Velocity(last, last_rate), elapsed=elapsed)
    assert abs(sent.forward) <= min(DRIVING.max_speed, DRIVING.acceleration * elapsed + abs(last))
    assert abs(sent.yaw_rate) <= DRIVING.max_turn_rate


def test_a_measured_stop_makes_more_careful_and_never_less() -> None:
    for speed, distance, planned in (
        (0.3, 0.0, 0.5),
        (0.3, 0.18, 0.5),  # 0.3 s of lag and 0.5 m/s²: as planned
        (0.3, 0.19, 0.3**2 / (2 * 0.19)),
        (1.0, 4.0, 0.125),
    ):
        assert safe_braking(DRIVING, speed, distance) == pytest.approx(planned)
