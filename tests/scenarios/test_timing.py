"""How evenly setpoints leave: measured in the server, against what is seen on the net."""

import struct
from itertools import pairwise
from typing import Any, NamedTuple

import pytest

from mav_tasks.config.settings import Settings
from mav_tasks.tasks.events import TaskChanged
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.client import ACCEPTED, REQUEST
from tests.kit.world import SETPOINT, World

TASK_TIMING = 54002
TICK = Settings().watch.setpoint_period


class TaskTiming(NamedTuple):
    """TASK_TIMING, decoded by hand as ``dialects/messages.md`` says."""

    time_boot_ms: int
    task_id: int
    intervals: int
    late: int
    rate: float
    p50: float
    p99: float
    longest: float
    target_system: int
    target_component: int


def ask(world: World, task_id: float) -> TaskTiming:
    """Ask for a timing."""
    before = len(list(world.client.of_id(TASK_TIMING)))
    sent = world.client.command(REQUEST, TASK_TIMING, task_id)
    world.run(0.05)
    assert sent.answer == (ACCEPTED, 0)
    shown = list(world.client.of_id(TASK_TIMING))[before:]
    return TaskTiming._make(struct.unpack("<4I4f2B", shown[0].payload.ljust(34, b"\0")))


def of_journal(world: World, new: S) -> Any:
    (event,) = [e for e in world.events(TaskChanged) if e.old is S.EXECUTING and e.new is new]
    assert event.timing is not None
    return event.timing


def captured(world: World) -> list[float]:
    """Return the list that the times of all setpoints to rovers end up in."""
    times: list[float] = []

    def sees(source: str, target: str, data: bytes) -> bool:
        if target.startswith("rover") and data[7] == SETPOINT:
            times.append(world.now)
        return False

    world.watched.loses = sees
    return times


def test_the_figures_are_those_of_the_net(world: World) -> None:
    times = captured(world)
    world.client.move(1.0)
    world.until_state(1, S.COMPLETED)
    changes = {e.new: e.at for e in world.events(TaskChanged)}
    began, ended = changes[S.EXECUTING], changes[S.COMPLETED]
    seen = [at for at in times if began <= at < ended]
    intervals = sorted(b - a for a, b in pairwise(seen))
    timing = of_journal(world, S.COMPLETED)
    assert timing.count == len(intervals) > 40
    assert timing.longest == pytest.approx(intervals[-1])
    assert timing.p50 == pytest.approx(intervals[len(intervals) // 2], abs=1e-4)
    assert timing.late == 0
    asked = ask(world, 1)
    assert asked[1:4] == (1, timing.count, 0)
    assert asked[4:8] == pytest.approx((20.0, timing.p50, timing.p99, timing.longest))
    assert asked[8:] == (255, 190)


def test_a_late_server_is_in_the_figures_of_the_running_task(world: World) -> None:
    world.client.move(5.0)
    world.until_state(1, S.EXECUTING)
    world.run(1)
    before = ask(world, 0)
    assert (before.task_id, before.late) == (1, 0)
    world.observer.expects_gaps = True
    world.suspend_server(0.2)
    world.run(0.5)
    after = ask(world, 0)
    assert after.late == 1
    assert 0.2 <= after.longest < 0.2 + 2 * TICK
    assert after.p50 == pytest.approx(TICK, abs=2e-4)
    assert after.intervals > before.intervals
