"""How evenly setpoints leave: measured in the server, against what is seen on the net."""

import asyncio
import struct
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from mav_tasks import Move, Refused
from mav_tasks.settings import Settings
from mav_tasks.tasks.events import TaskChanged
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.testing.options import RoverOptions
from rover_sim.testing.rover_world import RoverWorld
from tests.kit.client import ACCEPTED, REQUEST
from tests.kit.store import PromptSqliteStore
from tests.kit.world import SETPOINT, World
from tests.scenarios.conftest import MakeWorld

TASK_TIMING = 54002
UTC = 1.8e9  # s
TICK = Settings().watch.setpoint_period


class TaskTiming(NamedTuple):
    """TASK_TIMING, decoded by hand as ``dialects/README.md`` draws it."""

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


def test_the_interval_for_which_a_task_is_held_is_in_its_event(world: World) -> None:
    world.client.move(5.0)
    world.until_state(1, S.EXECUTING)
    world.run(1)
    world.observer.expects_gaps = True
    world.suspend_server(0.8)
    world.run(0.1)
    assert world.state(1) == (S.HELD, R.LATE)
    held = of_journal(world, S.HELD)
    assert held.longest >= 0.8
    assert held.late == 1
    world.until(world.stands, within=3)


def test_a_restart_forgets_no_figures(make_world: MakeWorld, tmp_path: Path) -> None:
    path = tmp_path / "tasks.sqlite3"
    world = make_world(store=PromptSqliteStore(path, wall_offset=UTC))
    world.client.move(0.5)
    world.until_state(1, S.COMPLETED)
    world.client.move(3.0)
    world.until_state(2, S.EXECUTING)
    world.run(1)
    world.client.pause()
    world.run(3)
    before = [ask(world, number) for number in (1, 2)]
    timings = [task.timing for task in world.tasks()]
    world.end_server()
    world.server.store.close()
    world.run(6)
    later = PromptSqliteStore(path, wall_offset=UTC)
    world.start_server(later, later.load())
    world.run(4.0)
    assert [task.timing for task in world.tasks()] == timings
    for number, earlier in enumerate(before, 1):
        again = ask(world, number)
        assert again[1:] == earlier[1:]
    world.client.proceed()
    world.until_state(2, S.COMPLETED)
    whole, half = world.task(2).timing, timings[1]
    assert whole is not None
    assert half is not None
    assert whole.count > half.count + 10
    assert whole.longest < 2 * TICK
    assert replace(whole, spread=()) == whole


def test_a_script_asks_for_them() -> None:
    world = RoverWorld(RoverOptions(noise="off"), seed=1, settings=Settings())
    try:
        world.server.start()
        world.until(lambda: world.server.is_ready)

        async def script() -> None:
            async with world.client() as client:
                task = await client.submit(Move(1.0))
                await asyncio.sleep(2.0)
                running = await client.timing()
                assert running.id == task.id
                await task.done()
                timing = await task.timing()
                assert (timing.id, timing.vehicle, timing.rate) == (task.id, 1, 20.0)
                assert timing.count > running.count > 10
                assert timing.p50 == pytest.approx(TICK, abs=1e-4)
                assert timing.max is not None
                assert timing.max < 2 * TICK
                with pytest.raises(Refused, match="no task runs"):
                    await client.timing()

        world.run(script())
    finally:
        world.close()
