"""What is foreseen of waiting tasks comes true."""

from math import isnan, nan

import pytest

from mav_tasks.tasks.events import TaskChanged
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.client import DRIVE, MOVE, ROTATE
from tests.kit.mission import Item
from tests.kit.world import World, at

WAYPOINT, DELAY, SPEED, JUMP, YAW, REPOSITION, HEAD = 16, 93, 178, 177, 115, 192, 213
START = 300


def submit(world: World, command: int, *params: float) -> int:
    sent = world.client.command(command, *params)
    world.run(0.1)
    return sent.task_id


def test_each_kind_begins_and_ends_when_it_was_foreseen(world: World) -> None:
    first = submit(world, DELAY, 6)
    world.until_state(first, S.EXECUTING)
    place = world.client.command_int(REPOSITION, -1, 1, 0, nan, frame=6, **at(4.0, 3.0))
    world.run(0.1)
    driven = [
        first,
        place.task_id,
        submit(world, MOVE, 3.0),
        submit(world, ROTATE, -200),
        submit(world, YAW, 90, 0, 0, 0),
        submit(world, DRIVE, 0.3, 0, 5),
        submit(world, HEAD, 180, 0.5, 1),
    ]
    # behind another, and more urgent than all
    later = submit(world, MOVE, 0.5, 0, 0, 0, driven[2], 3, 9)
    foreseen = {task: (world.shown(task), world.now) for task in (*driven[1:], later)}
    world.until_idle(tasks=len(driven) + 1, within=200)
    came = {(int(e.task_id), e.new): e.at for e in world.events(TaskChanged)}
    for task, (status, told_at) in foreseen.items():
        begins, ends = (came[task, state] - told_at for state in (S.STARTING, S.COMPLETED))
        assert status.time_to_start == pytest.approx(begins, rel=0.2, abs=2), task
        assert status.time_to_finish == pytest.approx(ends, rel=0.2, abs=2), task


def test_a_plan_ends_when_it_was_foreseen(world: World) -> None:
    world.upload(
        [
            Item(WAYPOINT, frame=0, current=1),
            Item(WAYPOINT, **at(4.0, 7.0)),
            Item(SPEED, param1=1, param2=1.0, param3=-1, frame=2),
            Item(WAYPOINT, **at(0.0, 7.0)),
            Item(DELAY, param1=3, frame=2),
            Item(JUMP, param1=1, param2=1, frame=2),
        ]
    )
    world.client.command(START, target=(1, 1))
    world.until_state(1, S.EXECUTING)
    status, since = world.shown(1), world.now
    world.until_idle(tasks=1, within=200)
    assert status.time_to_finish == pytest.approx(world.now - since, rel=0.2)


def test_what_nobody_can_know_is_not_foreseen(world: World) -> None:
    first = submit(world, DELAY, 100)
    world.until_state(first, S.EXECUTING)
    waiting = submit(world, MOVE, 1.0)
    due = submit(world, MOVE, 2.0, 0, 0, 0, 0, 300)
    begin, end = world.shown(waiting).time_to_start, world.shown(waiting).time_to_finish
    assert 98 < begin < end < 110
    assert world.shown(due).time_to_start == pytest.approx(299.5, abs=1)
    assert world.shown(due).time_to_finish > 300
    world.client.pause()
    world.run(1)
    assert isnan(world.shown(waiting).time_to_start)
    assert world.shown(due).time_to_start == pytest.approx(298, abs=2)
    assert isnan(world.shown(due).time_to_finish)
