"""Attack S7: whoever submits tasks for days must not use up the ids of all others.

A float32 names 16,777,215 of them exactly: 47 hours at the rate that a submitter may have.
"""

from struct import pack, unpack

from mav_tasks.store import MemoryStore
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import MAX_TASK_ID
from tests.kit.cases import for_each
from tests.kit.rows import check
from tests.kit.world import World

LAST_EXACT = 2**24 - 1
A_DAY = 86_400
TEN_YEARS = 3652 * A_DAY  # of a task a second


def param(number: int) -> float:
    """Return a large number as dialects/README.md has it in a float32."""
    value: float = unpack("<f", pack("<I", number | 0x80000000))[0]
    return value


def after_so_many(world: World, count: int) -> World:
    """Return a world whose server has given so many ids before."""
    world.end_server()
    world.start_server(MemoryStore(), Restored(next_id=count % MAX_TASK_ID + 1))
    world.run(5.0)
    return world


@for_each("count", [LAST_EXACT, TEN_YEARS, MAX_TASK_ID])
def test_tasks_are_taken_after_as_many_as_there_may_ever_be(world: World, count: int) -> None:
    after_so_many(world, count)
    first, second = world.client.move(0.3, nonce=1), world.client.move(0.2, nonce=2)
    world.run(0.3)
    expected = (1, 2) if count == MAX_TASK_ID else (count + 1, count + 2)
    assert (first.task_id, second.task_id) == expected
    world.until_state(second.task_id, S.COMPLETED)


def test_an_id_that_a_task_still_has_is_left_out(world: World) -> None:
    world.client.pause()
    waits = world.client.move(0.3)
    world.run(0.3)
    restored = Restored(tasks=(world.task(waits.task_id),), next_id=MAX_TASK_ID)
    world.end_server()
    world.start_server(MemoryStore(), restored)
    world.run(5.0)
    tasks = [world.client.move(0.2, nonce=number) for number in (2, 3)]
    world.run(0.3)
    assert [each.task_id for each in tasks] == [MAX_TASK_ID, waits.task_id + 1]


def test_an_id_above_what_a_float32_counts_is_named_by_its_bits(world: World) -> None:
    after_so_many(world, LAST_EXACT + 1)
    number = LAST_EXACT + 2  # odd, so that no float32 is it
    check(
        world,
        f"""
PAUSE : ACCEPTED
TASK_MOVE 1 0 0 1 : ACCEPTED #{number}
TASK_MOVE 1 0 0 2 {param(number)} : ACCEPTED #{number + 1}
SHOW {param(number)} : ACCEPTED status {number}: QUEUED
TASK_MODIFY {param(number)} 1 7 : ACCEPTED #{number}
""",
    )
    assert world.task(number + 1).terms.after == number
    assert world.task(number).priority == 7
    check(world, f"TASK_CANCEL {param(number)} : ACCEPTED #{number} / task {number}: CANCELLED")


def test_a_float32_that_was_rounded_names_no_task(world: World) -> None:
    after_so_many(world, LAST_EXACT)
    check(
        world,
        f"""
PAUSE : ACCEPTED
TASK_MOVE 1 : ACCEPTED #{2**24}
TASK_CANCEL {2**24} : DENIED #{R.BAD_PARAMETER} / task {2**24}: QUEUED
""",
    )
