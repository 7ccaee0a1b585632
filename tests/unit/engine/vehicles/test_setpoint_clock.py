"""The rhythm of setpoints."""

from itertools import pairwise
from math import inf

import pytest

from mav_tasks.engine.vehicles.setpoint_clock import SetpointClock

PERIOD = 0.05


def running(system_id: int = 1, *, now: float = 10.0) -> SetpointClock:
    clock = SetpointClock(system_id, period=PERIOD)
    clock.plan(now=now)
    return clock


def test_nothing_is_due_before_it_runs() -> None:
    clock = SetpointClock(1, period=PERIOD)
    assert (clock.is_running, clock.next_at, clock.lateness(now=5.0)) == (False, inf, -inf)


@pytest.mark.parametrize("now", [0.0, 0.01, 10.0, 12_345.678, 1e6 + 1 / 3])
def test_the_first_is_within_a_period(now: float) -> None:
    for system_id in range(1, 256):
        assert now <= running(system_id, now=now).next_at <= now + PERIOD


def test_ticks_follow_each_other_at_the_period_though_each_is_a_little_late() -> None:
    clock, ticks = running(), []
    for _ in range(20):
        ticks.append(clock.next_at)
        clock.plan(now=clock.next_at + 0.002)
        clock.plan(now=ticks[-1] + 0.003)  # asked again, it plans nothing more
    assert [b - a for a, b in pairwise(ticks)] == pytest.approx([PERIOD] * 19)


def test_after_a_long_delay_none_is_made_up_for() -> None:
    clock = running()
    late = clock.next_at + 7.3
    assert clock.lateness(now=late) == pytest.approx(7.3)
    clock.plan(now=late)
    assert late < clock.next_at <= late + PERIOD


@pytest.mark.parametrize("count", [2, 5, 20, 100])
def test_many_vehicles_tick_at_different_times(count: int) -> None:
    phases = sorted(running(n).next_at % PERIOD / PERIOD for n in range(1, count + 1))
    gaps = [b - a for a, b in pairwise([*phases, phases[0] + 1.0])]
    assert min(gaps) > 0.35 / count
    assert max(gaps) < 3 / count


def test_it_stops_and_restarts() -> None:
    clock = running()
    clock.stop()
    assert not clock.is_running
    clock.restart(now=20.0)
    assert 20.0 < clock.next_at <= 20.0 + PERIOD
