"""Intervals between setpoints: their figures against all of them sorted."""

from itertools import accumulate, pairwise
from math import ceil

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.tasks.lifecycle import TERMINAL, TaskReason, TaskState
from mav_tasks.tasks.timing import COARSE, COARSE_END, FINE, FINE_END, Timing, TimingMeter
from tests.unit.tasks.rig import BY, TICK, Rig, at, in_control

R, S = TaskReason, TaskState
PERIOD = 0.05
INTERVALS = st.lists(st.floats(0.0, 30.0) | st.floats(0.0, 2 * FINE_END), min_size=1, max_size=300)


def measured(intervals: list[float], *, before: Timing | None = None, at: float = 7.0) -> Timing:
    meter = TimingMeter(period=PERIOD, before=before)
    for now in accumulate(intervals, initial=at):
        meter.note(now=now)
    timing = meter.timing()
    assert timing is not None
    return timing


@given(intervals=INTERVALS)
def test_the_figures_are_those_of_the_sorted_intervals(intervals: list[float]) -> None:
    timing = measured(intervals)
    times = list(accumulate(intervals, initial=7.0))
    lengths = sorted(b - a for a, b in pairwise(times))
    assert timing.count == len(lengths)
    assert timing.longest == lengths[-1]
    assert timing.late == sum(length > 1.5 * PERIOD for length in lengths)
    for share, figure in ((0.5, timing.p50), (0.99, timing.p99)):
        exact = lengths[ceil(share * len(lengths)) - 1]
        resolution = FINE if exact < FINE_END - FINE else COARSE
        wanted = min(exact, COARSE_END)
        assert figure == pytest.approx(wanted, abs=resolution / 2 + 1e-9)


@given(earlier=INTERVALS, later=INTERVALS)
def test_what_is_gone_on_with_is_as_if_it_had_never_paused(
    earlier: list[float], later: list[float]
) -> None:
    first = measured(earlier)
    begin = 7.0 + sum(earlier) + 1000.0
    both = measured(later, before=first, at=begin)
    assert both.count == len(earlier) + len(later)
    assert both.longest < 100.0, "the pause itself is no interval"
    assert both.spread[1::2] != ()
    assert sum(both.spread[1::2]) == both.count
    assert both.late == first.late + measured(later, at=begin).late


def test_one_setpoint_is_no_interval() -> None:
    meter = TimingMeter(period=PERIOD)
    assert meter.timing() is None
    meter.note(now=1.0)
    assert meter.timing() is None


def test_memory_has_a_bound_whatever_the_intervals_are() -> None:
    timing = measured([0.0037 * (n % 9973) for n in range(30_000)])
    most = FINE_END / FINE + (COARSE_END - FINE_END) / COARSE + 2
    assert len(timing.spread) / 2 <= most
    assert timing.longest == pytest.approx(0.0037 * 9972)


def test_it_reads_as_a_line() -> None:
    assert str(measured([0.05] * 98 + [0.0512, 0.15])) == (
        "100 setpoints at 20 Hz: p50 50.0, p99 51.2, max 150.0 ms, 1 late"
    )


# of a task


def drive(rig: Rig, ticks: int, *, length: float = 0.5) -> None:
    for _ in range(ticks):
        rig.step(at(length))
        rig.tasks.executor.setpoint_left(now=rig.now)


def test_a_pause_is_no_interval_and_what_was_before_it_counts() -> None:
    rig = Rig().executing()
    drive(rig, 11)
    rig.tasks.pause(R.OPERATOR, actor=BY, now=rig.now)
    paused = rig.task(1).timing
    assert paused is not None
    assert paused.count == 10
    assert paused.longest == pytest.approx(TICK)
    for _ in range(40):  # zeros go on while it is paused
        rig.step(at(0.5, still=True))
        rig.tasks.executor.setpoint_left(now=rig.now)
    assert rig.task(1).timing == paused
    rig.tasks.proceed(at(0.5, still=True)(rig.now), actor=BY, now=rig.now)
    rig.step(at(0.5, still=True))
    assert rig.state(1) is S.EXECUTING
    drive(rig, 6)
    timing = rig.tasks.timing_of(rig.task(1))
    assert timing is not None
    assert timing.count == 15
    assert timing.longest == pytest.approx(TICK)


@pytest.mark.parametrize("state", [S.KILLED, S.HELD, S.CANCELLING])
def test_every_way_out_of_executing_has_the_figures(state: TaskState) -> None:
    rig = Rig().executing()
    drive(rig, 21)
    match state:
        case S.KILLED:
            rig.tasks.stop(clear=False, actor=BY, now=rig.now)
        case S.HELD:
            rig.tasks.hold(R.LATE, now=rig.now)
        case _:
            rig.tasks.cancel(rig.task(1), kill=False, reason=R.CANCELLED, actor=BY, now=rig.now)
    timing = rig.task(1).timing
    assert rig.state(1) is state
    assert timing is not None
    assert timing.count == 20
    assert bool(timing.spread) is (state not in TERMINAL), "nothing is added to what is over"


def test_a_task_that_was_never_driven_has_none() -> None:
    rig = Rig()
    rig.submit()
    rig.step(in_control)
    rig.tasks.executor.setpoint_left(now=rig.now)
    rig.tasks.stop(clear=True, actor=BY, now=rig.now)
    assert rig.task(1).timing is None
    assert rig.tasks.timing_of(rig.task(1)) is None
