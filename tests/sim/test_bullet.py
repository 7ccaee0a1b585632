"""The pybullet rover's physics, driven by a simple controller of the test's own."""

import builtins
import math
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from types import ModuleType

import pytest

from rover_sim import bullet
from rover_sim.body import BodyState, Pose, wrap_angle
from rover_sim.bullet import PHYSICS_RATE, BulletBody
from rover_sim.errors import MissingExtra

pytestmark = pytest.mark.pybullet

PERIOD = 0.05  # s, the test controller's
ORIGIN = Pose()
FRICTIONS = (0.5, 0.8, 1.1)


@contextmanager
def rover(
    *,
    start: Pose = ORIGIN,
    friction: float = 0.8,
    variation: float = 0.0,
    seed: int | None = None,
) -> Iterator[BulletBody]:
    pytest.importorskip("pybullet")
    body = BulletBody(start=start, friction=friction, variation=variation, seed=seed)
    with closing(body):
        yield body


def drive_straight(body: BulletBody, distance: float) -> BodyState:
    """Drive at up to 0.5 m/s, slower towards the end; give the state at rest."""
    start, speed = body.state, 0.0
    for _ in range(400):
        along, _ = offset(start, body.state)
        left = distance - along
        if left < 0.002:
            break
        speed = min(speed + 0.025, 0.5, max(0.03, 2.0 * left))
        body.drive(speed, 1.5 * wrap_angle(start.yaw - body.state.yaw))
        body.advance(PERIOD)
    return at_rest(body)


def turn_on_the_spot(body: BulletBody, angle: float) -> BodyState:
    """Turn at up to 0.8 rad/s with an integrating yaw rate loop; give the state at rest."""
    goal, rate, correction = body.state.yaw + angle, 0.0, 0.0
    for _ in range(400):
        left = wrap_angle(goal - body.state.yaw)
        if abs(left) < 0.003:
            break
        rate = min(rate + 0.1, 0.8, max(0.05, 2.0 * abs(left)))
        wanted = math.copysign(rate, left)
        correction += 4.0 * PERIOD * (wanted - body.state.yaw_rate)
        body.drive(0.0, wanted + correction)
        body.advance(PERIOD)
    return at_rest(body)


def at_rest(body: BulletBody) -> BodyState:
    body.drive(0.0, 0.0)
    body.advance(PERIOD * 10)
    return body.state


def offset(start: BodyState, now: BodyState) -> tuple[float, float]:
    """How far along and across the starting heading."""
    dn, de = now.north - start.north, now.east - start.east
    cos, sin = math.cos(start.yaw), math.sin(start.yaw)
    return dn * cos + de * sin, de * cos - dn * sin


def test_forward_two_metres_in_a_straight_line() -> None:
    for friction in FRICTIONS:
        for yaw in [0.0, 2.0]:
            with rover(start=Pose(yaw=yaw), friction=friction) as body:
                start = body.state
                along, across = offset(start, drive_straight(body, 2.0))
                assert along == pytest.approx(2.0, abs=0.01)
                assert across == pytest.approx(0.0, abs=0.01)


def test_quarter_turn_on_the_spot() -> None:
    for friction in FRICTIONS:
        for angle in [90.0, -90.0]:
            with rover(friction=friction) as body:
                start = body.state
                end = turn_on_the_spot(body, math.radians(angle))
                assert math.degrees(end.yaw - start.yaw) == pytest.approx(angle, abs=0.5)
                assert offset(start, end) == pytest.approx((0.0, 0.0), abs=0.01)


def manoeuvre(seed: int, *, steps_at_once: int) -> BodyState:
    with rover(variation=0.3, seed=seed) as body:
        for step in range(120):
            jerk = 3.0 if step % 40 == 0 else 0.0  # more than the motors can do at once
            body.drive(min(1.0, step * 0.02) - jerk, 0.8 * math.sin(step / 20))
            for _ in range(6 // steps_at_once):
                body.advance(steps_at_once / PHYSICS_RATE)
        return body.state


def test_motors_can_stall() -> None:
    """At the same torque in plain and in sub-steps: the limit is easily lost among the latter."""
    with rover(friction=6.0) as body:  # turning takes about 50 N·m a wheel
        body.drive(0.0, 1.0)
        for _ in range(40):
            body.advance(6 / PHYSICS_RATE)
        assert body.state.yaw_rate == pytest.approx(0.0, abs=0.01)


def test_a_seed_repeats_a_run_and_another_changes_it() -> None:
    first, again, other = (manoeuvre(seed, steps_at_once=6) for seed in (1, 1, 2))
    assert first == again
    assert (first.north, first.east) != (other.north, other.east)


def test_missing_pybullet_is_one_line_that_says_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    real_import = builtins.__import__

    def blocked(name: str, *rest: object) -> ModuleType:
        if name == "pybullet":
            raise ImportError(name)
        return real_import(name, *rest)  # type: ignore[arg-type]

    monkeypatch.delitem(sys.modules, "pybullet", raising=False)
    monkeypatch.setattr(builtins, "__import__", blocked)
    with pytest.raises(MissingExtra) as caught:
        bullet.BulletBody(start=Pose())
    assert "pip install pybullet numpy" in str(caught.value)
    assert "\n" not in str(caught.value)
