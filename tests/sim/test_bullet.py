"""The pybullet rover's physics, driven by a simple controller of the test's own."""

import builtins
import math
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from types import ModuleType

import pytest

from rover_sim import bullet
from rover_sim.body import BodyState, Pose
from rover_sim.bullet import PHYSICS_RATE, BulletBody
from rover_sim.errors import MissingExtra

pytestmark = pytest.mark.pybullet

ORIGIN = Pose()


@contextmanager
def rover(
    *,
    start: Pose = ORIGIN,
    friction: float = 0.8,
    variation: float = 0.0,
    seed: int | None = None,
) -> Iterator[BulletBody]:
    body = BulletBody(start=start, friction=friction, variation=variation, seed=seed)
    with closing(body):
        yield body


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
