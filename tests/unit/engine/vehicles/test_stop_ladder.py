"""What is done to make a rover stand, step after step."""

from collections.abc import Callable

from mav_tasks.engine.vehicles.stop_ladder import Step, StopLadder

TICK = 0.05  # s


def climbed(
    speed: Callable[[float], float | None],
    *,
    seconds: float = 12.0,
    holds_at: float | None = None,
    disarm_after: float = 2.0,
) -> list[tuple[float, Step]]:
    """Return the steps of a rover whose speed is a function of the time since it was told."""
    ladder, steps = StopLadder(), []
    ladder.begin(now=100.0)
    for tick in range(round(seconds / TICK)):
        after = tick * TICK
        step = ladder.climb(
            speed=speed(after),
            is_held=holds_at is not None and after >= holds_at,
            disarm_after=disarm_after,
            now=100.0 + after,
        )
        if step is not None:
            steps.append((round(after, 2), step))
            if step is Step.HOLD and holds_at is None:
                holds_at = after + 0.1
    return steps


def braking(rate: float, *, speed: float = 1.0, reaction: float = 0.28) -> Callable[[float], float]:
    return lambda after: max(0.0, speed - rate * max(0.0, after - reaction))


def test_a_rover_that_brakes_gets_set_points_only() -> None:
    for rate in (0.27, 0.5, 0.9, 4.0):
        assert climbed(braking(rate)) == []
        assert climbed(braking(rate, speed=2.2)) == []


def test_one_whose_throttle_stick_is_held_gets_hold_within_0_7_s() -> None:
    [(at, step)] = climbed(
        lambda after: 1.9 if after < 0.8 else max(0.0, 1.9 - 1.7 * (after - 0.8))
    )
    assert step is Step.HOLD
    assert at <= 0.7


def test_one_that_circles_on_in_hold_is_disarmed_2_s_later() -> None:
    steps = climbed(lambda after: 0.32)
    assert [step for _, step in steps] == [Step.HOLD, Step.DISARM]
    assert steps[1][0] - steps[0][0] <= 2.2


def test_one_that_rolls_out_in_hold_is_not_disarmed() -> None:
    """An ArduPilot that steers as a car: 2.2 m in 7 s from 1 m/s."""
    assert climbed(braking(0.14), holds_at=0.1) == []


def test_a_setting_switches_disarming_off() -> None:
    assert [step for _, step in climbed(lambda after: 0.32, disarm_after=float("inf"))] == [
        Step.HOLD
    ]


def test_where_nothing_is_known_of_its_speed_hold_follows() -> None:
    assert climbed(lambda after: None, seconds=2.0)[0][1] is Step.HOLD


def test_the_noise_of_a_standing_rover_is_no_motion() -> None:
    assert climbed(lambda after: 0.05 + 0.05 * (round(after / TICK) % 3)) == []
