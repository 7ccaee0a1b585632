"""Whether a vehicle that is told to stand still rolls on, so that it is braked."""

import pytest

from mav_tasks.engine.vehicles.motion_guard import BRAKES_WITHIN, MotionGuard, Told
from mav_tasks.engine.vehicles.motion_monitor import MotionMonitor
from mav_tasks.mavlink.messages import Attitude, LocalPositionNed
from mav_tasks.settings import Watch

PERIOD = 0.05  # s
DRIVES = Told(
    forward=0.5,
    moves=True,
    is_ours=True,
    is_stopping=False,
    rolls_out=True,
    may_drive=True,
    goes_on=True,
    is_released=False,
    is_held=False,
    armed=True,
    still=False,
    heard=True,
)
STANDS = DRIVES._replace(forward=0.0, moves=False)


def guarded(
    *, forward: float, sideways: float = 0.0, reported: float | None = None, told: Told = STANDS
) -> tuple[MotionGuard, float]:
    """Return a guard that has seen a second of such motion, north as it points, after a drive."""
    monitor = MotionMonitor(Watch())
    guard = MotionGuard(monitor, Watch())
    guard.look(DRIVES, now=0.0)
    now = 0.0
    for number in range(1, 21):
        now = number * PERIOD
        boot_ms = round(1000 * now)
        monitor.receive(Attitude(boot_ms, 0, 0, 0.0, 0, 0, 0), now=now)
        speed = forward if reported is None else reported
        monitor.receive(
            LocalPositionNed(boot_ms, forward * now, sideways * now, 0, speed, 0, 0), now=now
        )
        guard.look(told, now=now)
    return guard, now


@pytest.mark.parametrize(
    ("forward", "rolls_out", "brakes"),
    [(0.3, True, True), (0.3, False, True), (0.05, True, True), (0.05, False, False)],
)
def test_one_that_rolls_on_is_braked_a_car_of_ardupilot_s_to_the_last(
    forward: float, *, rolls_out: bool, brakes: bool
) -> None:
    guard, now = guarded(forward=forward)
    assert guard.brakes(rolls_out=rolls_out, now=now) is brakes


@pytest.mark.parametrize(
    ("forward", "sideways", "reported"),
    [(0.0, 0.4, 0.4), (0.0, 0.0, 0.4), (0.4, 0.0, 0.0)],
    ids=["to the side", "reported only", "by its position only"],
)
def test_what_an_estimate_wanders_is_no_rolling(
    forward: float, sideways: float, reported: float
) -> None:
    guard, now = guarded(forward=forward, sideways=sideways, reported=reported)
    assert not guard.brakes(rolls_out=True, now=now)


def test_long_after_it_was_told_to_move_it_is_not_rolling_on_from_that() -> None:
    guard, now = guarded(forward=0.3)
    assert not guard.brakes(rolls_out=True, now=now + BRAKES_WITHIN)
