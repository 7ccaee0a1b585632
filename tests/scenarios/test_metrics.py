"""Metrics of a server in virtual time: exact counts and times of what happened."""

from collections.abc import Callable
from dataclasses import replace
from math import inf
from typing import Any

import pytest

from mav_tasks.engine.inputs import LinkSide
from mav_tasks.in_memory import CLIENT_LINK, VEHICLE_LINK
from mav_tasks.metrics import families as f
from mav_tasks.metrics.collector import Collector
from mav_tasks.metrics.exposition import Family
from mav_tasks.observer import EngineObservers
from mav_tasks.tasks.events import TaskModified, TaskSubmitted
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.task import TaskId, Terms
from rover_sim.personas import PX4, Persona
from tests.kit.cases import anew, for_each
from tests.kit.store import LateStore
from tests.kit.world import PROMPT, World

R, S = TaskReason, TaskState
MakeWorld = Callable[..., World]


def watched(world: World) -> Collector:
    """Return a collector that sees all from now on, the beginning of the world."""
    collector = Collector(
        world.server.engine.figures,
        links={
            LinkSide.CLIENTS: [world.net._links[CLIENT_LINK]],
            LinkSide.VEHICLES: [world.net._links[VEHICLE_LINK]],
        },
        recorders=[],
        restored=None,
        version="",
        woke_at=lambda: world.now,
        clock=lambda: world.now,
    )
    collector._events = world.server.engine._registry.recorded
    world.server.pump._observers = EngineObservers([collector])
    return collector


def samples(collector: Collector, family: Family) -> dict[tuple[object, ...], Any]:
    totals, vehicles = collector.totals()
    return dict([*totals.get(family, ()), *collector.vehicles(vehicles).get(family, ())])


def tasks(collector: Collector) -> dict[tuple[object, ...], Any]:
    return samples(collector, f.TASKS)


@anew
def world(make_world: MakeWorld) -> World:
    return make_world()


def test_a_task_is_counted_from_its_submission_to_its_end(world: World) -> None:
    collector = watched(world)
    world.ready()
    first = world.client.move(1.0)
    second = world.client.move(0.5)
    third = world.client.rotate(30)
    world.until(lambda: samples(collector, f.SUBMITTED) == {(1,): 3}, within=5)
    world.until(lambda: (1, S.EXECUTING, R.NONE) in tasks(collector), within=10)
    assert tasks(collector) == {
        (1, S.EXECUTING, R.NONE): 1,
        (1, S.QUEUED, R.BEHIND_OTHERS): 2,
    }
    assert samples(collector, f.QUEUE_LENGTH) == {(1,): 2}
    world.until(lambda: samples(collector, f.ENDED) == {(1, S.COMPLETED, R.NONE): 3}, within=60)
    assert (tasks(collector), samples(collector, f.QUEUE_LENGTH)) == ({}, {(1,): 0})
    waits = samples(collector, f.WAIT)[()]
    all_tasks = [world.task(sent.task_id) for sent in (first, second, third)]
    assert waits.count == 3
    timings = [task.timing for task in all_tasks if task.timing is not None]
    intervals = samples(collector, f.INTERVAL)[1,]
    assert intervals.count == sum(timing.count for timing in timings) > 50
    assert intervals.total == pytest.approx(0.05 * intervals.count, rel=0.01)


@for_each("persona", [PROMPT, PX4])
def test_a_stop_is_timed_until_the_setpoint_and_until_it_stands(
    make_world: MakeWorld, persona: Persona
) -> None:
    world = make_world(persona=persona)
    collector = watched(world)
    world.ready()
    world.client.move(20.0)
    world.until(lambda: world.truth.forward_speed > 0.45, within=20)
    world.client.move(1.0)
    world.run(1.0)
    asked_at = world.now
    world.client.stop()
    world.until(lambda: samples(collector, f.STOP_LATENCY)[()].count == 1, within=1)
    assert samples(collector, f.STOP_LATENCY)[()].total == 0.0  # a turn takes no virtual time
    assert samples(collector, f.HALTS) == {(1, R.STOPPED): 1}
    assert samples(collector, f.QUEUE_PAUSED) == {(1, R.STOPPED): 1}
    assert samples(collector, f.ENDED) == {(1, S.KILLED, R.STOP): 1}
    assert tasks(collector) == {(1, S.QUEUED, R.QUEUE_PAUSED): 1}
    world.until(lambda: samples(collector, f.STOP_STANDSTILL)[()].count == 1, within=10)
    took = samples(collector, f.STOP_STANDSTILL)[()].total
    assert took == pytest.approx(world.now - asked_at, abs=0.1)
    assert abs(world.truth.forward_speed) < 0.03
    world.client.stop()
    world.run(1.0)
    assert samples(collector, f.STOP_STANDSTILL)[()].count == 1, "it stood already"


def test_a_rover_that_falls_silent_grows_old(world: World) -> None:
    collector = watched(world)
    world.ready()
    world.run(2.0)
    assert samples(collector, f.HEARTBEAT_AGE)[1,] <= 1.1
    assert samples(collector, f.POSITION_AGE)[1,] < 0.2
    world.leave(world.rover_parties[0])
    world.run(10.0)
    assert 9.0 < samples(collector, f.HEARTBEAT_AGE)[1,] < 11.2
    assert 9.0 < samples(collector, f.POSITION_AGE)[1,] < 10.3


def test_each_write_of_the_store_is_timed_until_it_is_durable(make_world: MakeWorld) -> None:
    world = make_world(store=LateStore(delay=0.15))
    collector = watched(world)
    world.ready()
    world.client.move(0.3)
    world.until(lambda: samples(collector, f.ENDED) != {}, within=30)
    world.run(1.0)
    assert samples(collector, f.PENDING) == {(): 0}
    commits = samples(collector, f.COMMIT)[()]
    assert commits.count >= 4
    assert commits.total == pytest.approx(0.15 * commits.count, rel=0.2)


def test_what_is_not_stored_in_time_is_refused_once_and_no_longer_waits(
    make_world: MakeWorld,
) -> None:
    store = LateStore()
    world = make_world(store=store)
    collector = watched(world)
    world.ready()
    store.delay = inf
    world.client.move(0.3)
    world.until(lambda: samples(collector, f.REFUSED) != {}, within=5)
    world.run(1.0)
    assert samples(collector, f.REFUSED) == {(R.STORE_UNAVAILABLE,): 1}
    assert samples(collector, f.QUEUE_LENGTH) == {(1,): 0}
    assert (collector._submitted, samples(collector, f.ENDED)) == ({}, {})
    assert samples(collector, f.PENDING)[()] > 0


def test_a_staged_task_needs_a_start_command_and_another_its_dependency(world: World) -> None:
    collector = watched(world)
    world.ready()
    first = world.client.move(5.0)
    world.until(lambda: first.ack is not None, within=5)
    waits = world.client.command(54000, 1.0, 0, 0, 0, first.task_id)
    world.until(lambda: waits.ack is not None, within=5)
    blocked = (1, S.BLOCKED, R.DEPENDENCY)
    assert tasks(collector)[blocked] == 1
    task = world.task(waits.task_id)
    staged = replace(task, id=TaskId(99), terms=Terms(is_staged=True))
    collector.on_output([], [TaskSubmitted(staged, world.now)], now=world.now)
    assert tasks(collector)[1, S.BLOCKED, R.WAITING_FOR_START] == 1
    assert blocked not in tasks(collector), "one is blocked, of which one is staged"
    started = TaskModified(TaskId(99), 1, 2, Terms(), "a client", world.now, staged.terms)
    collector.on_output([], [started], now=world.now)
    assert tasks(collector)[blocked] == 1
