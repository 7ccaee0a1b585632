"""A rover that drives faster than it was told to is seen within half a second."""

import pytest

from mav_tasks.engine.vehicles.overspeed import Overspeed

TICK = 0.05  # s


def seen_after(asked: float, speed: float, *, seconds: float = 5.0) -> float | None:
    """Return the seconds until it is seen, None if it is not."""
    watch = Overspeed()
    for tick in range(round(seconds / TICK)):
        if watch.look(asked, speed, now=tick * TICK) is not None:
            return tick * TICK
    return None


@pytest.mark.parametrize(("asked", "speed"), [(0.1, 1.9), (0.5, 3.1), (1.0, 6.1), (-0.5, 1.9)])
def test_a_stick_that_adds_to_the_speed_is_seen(asked: float, speed: float) -> None:
    after = seen_after(asked, speed)
    assert after is not None
    assert after <= 0.25


@pytest.mark.parametrize(("asked", "speed"), [(0.5, 0.68), (0.2, 0.9), (1.0, 1.37), (0.0, 1.9)])
def test_the_overshoot_of_a_healthy_rover_is_none(asked: float, speed: float) -> None:
    assert seen_after(asked, speed) is None


def test_a_rover_that_slows_down_after_it_was_asked_to_is_not_too_fast() -> None:
    watch = Overspeed()
    assert watch.look(1.0, 1.0, now=0.0) is None
    assert watch.look(0.1, 1.0, now=0.05) is None
    assert watch.look(0.1, 0.9, now=0.9) is None
