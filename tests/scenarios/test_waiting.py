"""Tasks that wait for a time or for each other, and what is changed about them meanwhile."""

import pytest

from mav_tasks.engine.inputs import WallClock
from mav_tasks.tasks.events import TaskChanged
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, MOVE
from tests.kit.rows import check
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

MODIFY = 54012
PRIORITY, START_DELAY, DEADLINE, RUN_AFTER, PREEMPTIBLE, PREEMPTIVE, START_UTC = range(1, 8)
UTC = 1_800_000_000.0  # s, at the beginning of these worlds
DAY = 86_400.0


def submit(
    world: World,
    distance: float = 0.2,
    *,
    after: int = 0,
    delay: float = 0,
    priority: float = 5,
    target: tuple[int, int] = (1, 191),
) -> int:
    sent = world.client.command(MOVE, distance, 0, 0, 0, after, delay, priority, target=target)
    world.run(0.05)
    return sent.task_id


def set_clock(world: World, offset: float) -> None:
    world.server.pump.handle(WallClock(offset - world.now), now=world.now)
    world.server.pump.turn(now=world.now)


def order_of_start(world: World) -> list[int]:
    return [e.task_id for e in world.events(TaskChanged) if e.new is S.STARTING]


def test_a_start_delay_counts_from_the_acknowledgement(world: World) -> None:
    at = world.now
    task = submit(world, delay=3)
    later = submit(world, 0.1)
    assert world.client.statuses(task)[-1].why == (S.SCHEDULED, R.START_TIME)
    world.until_idle(tasks=2)
    assert order_of_start(world) == [later, task]
    begun = (S.STARTING, S.EXECUTING)
    started = next(s for s in world.client.statuses(task) if s.state in begun)
    assert started.time_boot_ms / 1000 == pytest.approx(at + 3, abs=0.3)


def test_a_utc_start_is_exact_and_moves_with_the_clock_and_nothing_else_does(world: World) -> None:
    set_clock(world, UTC)
    world.client.pause()
    delayed = submit(world, delay=20)
    task = submit(world)
    sent = world.client.command_int(MODIFY, task, START_UTC, x=int(UTC + world.now + 5), frame=0)
    world.run(0.1)
    assert sent.answer == (ACCEPTED, task)
    assert world.state(task)[0] is S.SCHEDULED
    set_clock(world, UTC - DAY)
    world.run(10)
    assert [world.state(i)[0] for i in (delayed, task)] == [S.SCHEDULED, S.SCHEDULED]
    set_clock(world, UTC + DAY)
    world.run(0.1)
    assert [world.state(i)[0] for i in (delayed, task)] == [S.SCHEDULED, S.QUEUED]
    world.client.proceed()
    world.until_state(task, S.COMPLETED)
    assert world.state(delayed)[0] is S.SCHEDULED
    world.until_idle(tasks=2)


@for_each("step", [DAY, -DAY, 2.0, -2.0])
def test_a_step_of_the_clock_changes_no_motion_no_delay_and_no_deadline(
    world: World, step: float
) -> None:
    set_clock(world, UTC)
    driven, late = submit(world, 2.0), submit(world)
    world.client.command(MODIFY, late, DEADLINE, 1.5)
    world.run(0.1)
    delayed = submit(world, delay=3.0)
    at = world.now
    world.run(1.0)
    assert world.state(driven)[0] is S.EXECUTING
    set_clock(world, UTC + step)
    assert world.state(late)[0] is S.QUEUED
    world.until_state(late, S.EXPIRED, within=1.0)
    world.until(lambda: world.state(delayed)[0] is S.QUEUED, within=3.5)
    assert world.now - at == pytest.approx(3.0, abs=0.1)
    world.until_state(driven, S.COMPLETED, within=20)
    states = [state for state, _ in world.history(driven)]
    assert states == [S.STARTING, S.EXECUTING, S.COMPLETED]  # and 20 Hz: the observer looks at it


def test_a_deadline_ends_what_has_not_begun(world: World) -> None:
    failed = "FAILED DEPENDENCY_FAILED"
    check(
        world,
        f"""
TASK_MOVE 3 : ACCEPTED #1
TASK_MOVE 0.2 : ACCEPTED #2
TASK_MOVE 0.2 0 0 0 2 : ACCEPTED #3
TASK_MOVE 0.2 0 0 0 3 : ACCEPTED #4
TASK_MODIFY 2 3 2 & wait 2.2 : ACCEPTED #2 / task 2: EXPIRED DEADLINE / task 3: {failed}
wait 0 : - task 4: {failed} / queue NONE
""",
    )


def test_tasks_run_after_each_other_across_rovers(make_world: MakeWorld) -> None:
    world = make_world(rovers=2)
    first = submit(world, 0.4, target=(1, 191))
    second = submit(world, 0.3, after=first, target=(2, 191))
    third = submit(world, 0.2, after=second, target=(1, 191))
    assert [world.state(i)[0] for i in (second, third)] == [S.BLOCKED, S.BLOCKED]
    assert world.task(second).terms.after == first
    world.until_idle(tasks=3)
    assert order_of_start(world) == [first, second, third]


def test_a_task_goes_ahead_with_the_rank_of_the_most_urgent_that_waits_for_it(world: World) -> None:
    check(
        world,
        """
DO_PAUSE_CONTINUE 0 : ACCEPTED
TASK_MOVE 0.2 0 0 0 0 0 2 : ACCEPTED #1
TASK_MOVE 0.3 0 0 0 0 0 5 : ACCEPTED #2
TASK_MOVE 0.2 0 0 0 1 0 1 : ACCEPTED #3
TASK_MOVE 0.1 0 0 0 3 0 8 : ACCEPTED #4
""",
    )
    for changed, order in (("1 8", [1, 2]), ("1 4", [2, 1]), ("1 8", [1, 2]), ("4 2", [2, 1])):
        check(world, f"TASK_MODIFY 4 {changed} : ACCEPTED #4")
        assert in_order(world, 1, 2) == order, changed
    check(world, "TASK_MODIFY 4 4 3 : ACCEPTED #4")
    assert in_order(world, 1, 2) == [1, 2]
    check(world, "TASK_CANCEL 4 : ACCEPTED #4")
    assert in_order(world, 1, 2) == [2, 1]
    world.client.proceed()
    world.until_idle(tasks=4)
    assert order_of_start(world) == [2, 1, 3]


def test_what_is_scheduled_comes_when_its_time_comes(world: World) -> None:
    world.client.pause()
    early, usual = submit(world, delay=3), submit(world, 0.3)
    world.run(2)
    late = submit(world, 0.4)
    world.run(2)
    assert in_order(world, early, usual, late) == [usual, late, early]
    world.client.proceed()
    world.until_idle(tasks=3)
    assert order_of_start(world) == [usual, late, early]


def test_a_bad_modification_changes_nothing(world: World) -> None:
    submit(world, 2)
    second = submit(world)
    submit(world, after=second)
    before = world.task(second)
    check(
        world,
        """
TASK_MODIFY 2 1 11 : DENIED param3 priority 11
TASK_MODIFY 2 1 nan : DENIED param3 priority
TASK_MODIFY 2 nan 1 : DENIED param2 property
TASK_MODIFY 2 4 3 : DENIED the tasks would wait for each other
TASK_MODIFY 2 4 77 : DENIED 77
TASK_MODIFY 2 8 1 : DENIED LABEL must be sent as COMMAND_INT
TASK_MODIFY 2 5 2 : DENIED param3 pre-emptible 2
TASK_MODIFY 2 2 -1 : DENIED param3 start delay -1
""",
    )
    assert world.task(second) == before


def test_a_task_is_put_between_two_others_and_keeps_its_priority(world: World) -> None:
    world.client.pause()
    for number, priority in enumerate((5, 5, 2, 9), 1):
        submit(world, number / 10, priority=priority)
    for row in ["3 2: 4132", "2 3: 4123", "1 4: 1423", "4 3: 1243", "1 0: 2431", "3 0: 2413"]:
        changed, _, order = row.partition(": ")
        task, other = changed.split()
        check(world, f"TASK_MODIFY {task} 11 {other} : ACCEPTED #{task}")
        assert in_order(world, 1, 2, 3, 4) == list(map(int, order)), row
    assert [world.task(each).priority for each in (1, 3, 4)] == [5, 2, 9]
    submit(world, 0.5)
    check(world, "TASK_MODIFY 4 1 4 : ACCEPTED #4")
    assert in_order(world, 1, 2, 3, 4, 5) == [2, 1, 3, 5, 4]
    check(world, f"TASK_MODIFY 4 11 77 : DENIED #{R.WRONG_STATE}")


def in_order(world: World, *tasks: int) -> list[int]:
    return sorted(tasks, key=lambda task: world.shown(task).queue_position)
