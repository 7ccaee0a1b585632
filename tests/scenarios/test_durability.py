"""What acknowledges a task, or moves a rover for it, leaves only after the task is durable."""

from math import inf

import pytest

from mav_tasks.tasks.events import TaskWithdrawn
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import anew, for_each
from tests.kit.client import ACCEPTED, FAILED, TEMPORARILY_REJECTED
from tests.kit.rows import ask
from tests.kit.store import LateStore
from tests.kit.world import World, put_home
from tests.scenarios.conftest import MakeWorld


@anew
def store() -> LateStore:
    return LateStore()


@anew
def world(make_world: MakeWorld, store: LateStore) -> World:
    return make_world(store=store)


def test_the_ack_comes_when_the_task_is_durable(world: World, store: LateStore) -> None:
    store.delay = 0.25
    at = world.now
    sent = world.client.move(1)
    world.run(0.24)
    assert (sent.ack, world.state(1)[0]) == (None, S.QUEUED)
    world.run(0.1)
    assert sent.answer == (ACCEPTED, 1)
    assert sent.acked_at - at == pytest.approx(0.26, abs=0.03)
    world.until_idle(tasks=1)
    assert world.state(1)[0] is S.COMPLETED


def test_motion_waits_until_executing_is_durable(world: World, store: LateStore) -> None:
    world.client.move(1)
    world.until_state(1, S.STARTING, within=1)
    store.delay = inf
    world.run(15)  # longer than a rover may be stuck
    assert world.state(1)[0] is S.EXECUTING
    assert "move" not in world.observer.sent_since(0)
    assert world.truth.north == 0.0
    store.delay = 0.0
    world.until_idle(tasks=1)
    assert world.state(1)[0] is S.COMPLETED


def test_what_is_not_durable_in_time_is_withdrawn_and_works_later(
    world: World, store: LateStore
) -> None:
    store.delay = inf
    at = world.now
    refused = world.client.move(1)
    world.run(0.6)
    assert refused.answer == (TEMPORARILY_REJECTED, R.STORE_UNAVAILABLE)
    assert 0.4 <= refused.acked_at - at <= 0.5
    assert world.tasks() == ()
    assert [e.task_id for e in world.events(TaskWithdrawn)] == [1]

    meanwhile = world.client.rotate(10)
    world.run(0.1)
    assert meanwhile.answer == (TEMPORARILY_REJECTED, R.STORE_UNAVAILABLE)

    store.delay = 0.0
    world.run(0.1)
    again = world.client.move(1)
    world.until(lambda: again.ack, within=0.1)
    world.until_idle(tasks=1)
    assert (again.task_id, world.state(2)[0]) == (2, S.COMPLETED)
    assert world.client.acks_of(54000) == [
        (TEMPORARILY_REJECTED, R.STORE_UNAVAILABLE),
        (ACCEPTED, 2),
    ]


def test_a_store_that_failed_refuses_until_it_commits_again(world: World, store: LateStore) -> None:
    for _ in range(2):  # as it says for as long as it lasts
        store.fail("disk full")
        world.run(0.1)
    told = "Store failed: new tasks are refused. See the server's log"
    assert world.client.texts().count(told) == 1
    refused = world.client.move(1)
    world.run(0.1)
    assert refused.answer == (TEMPORARILY_REJECTED, R.STORE_UNAVAILABLE)
    world.run(0.1)  # the refusal itself was committed
    again = world.client.move(1)
    world.run(0.1)
    assert again.answer == (ACCEPTED, 1)


def test_a_blocked_store_does_not_keep_a_driving_rover_from_its_end(
    world: World, store: LateStore
) -> None:
    world.client.move(1)
    world.until_state(1, S.EXECUTING)
    world.run(0.2)
    store.delay = inf
    world.until_idle(tasks=1)
    assert world.state(1)[0] is S.COMPLETED


def test_nobody_is_told_of_a_task_that_is_not_durable(world: World, store: LateStore) -> None:
    other = world.add_client("other")
    world.run(1)
    store.delay = 0.3
    before = len(other.texts())
    world.client.move(1)
    world.run(0.28)
    assert (other.texts()[before:], world.client.statuses()) == ([], [])
    world.run(0.1)
    assert other.texts()[before] == "Task 1 queued: move 1 m"
    assert not world.client.said("queued")  # it reads TASK_STATUS
    assert world.client.statuses()[0].task_id == 1


@for_each("delay, told_after", [(0.2, 0.2), (inf, 0.4)])
@for_each("by", ["kill", "STOP"])
def test_that_a_task_is_over_is_told_when_it_is_durable_or_the_store_too_slow(
    world: World, store: LateStore, by: str, delay: float, told_after: float
) -> None:
    world.client.move(2, nonce=1)
    world.until_state(1, S.EXECUTING)
    world.run(1)
    store.delay = delay
    at = world.now
    sent = world.client.command(54010, 1, 1) if by == "kill" else world.client.stop()
    world.run(0.05)
    assert sent.answer == ((ACCEPTED, 1) if by == "STOP" else None)  # which has a record of its own
    assert {"zero", "HOLD"} <= set(world.observer.sent_since(at))
    world.run(told_after - 0.06)
    assert world.state(1)[0] is S.KILLED
    assert {status.state for status in world.client.statuses(1)} == {S.STARTING, S.EXECUTING}
    world.run(0.05)
    assert world.client.statuses(1)[-1].state == S.KILLED
    not_kept = by == "kill" and delay == inf
    assert sent.answer == ((FAILED, R.STORE_UNAVAILABLE) if not_kept else (ACCEPTED, 1))


@for_each(
    "words",
    ["DO_REPOSITION -1 1 0 nan frame=6 at=3,0 to=autopilot", "DO_SET_MODE 1 11 0 to=autopilot"],
)
def test_a_refused_word_ends_no_pause(world: World, store: LateStore, words: str) -> None:
    put_home(world, -2, 0)
    world.client.pause()
    world.run(0.1)
    store.delay = inf
    ask(world, words)
    world.run(1)
    store.delay = 0.0
    assert world.client.texts()[-1] == "not stored in time: not accepted; queue paused"
    world.client.move(1)
    world.run(4)
    assert (world.states(), world.stands()) == ([S.QUEUED], True)
    ask(world, words)
    world.until_faster(0.2)


@for_each("words", ["TASK_MODIFY 1 9 15", "TASK_MODIFY 1 1 7"])
def test_a_change_is_acknowledged_once_it_is_durable_else_undone(
    world: World, store: LateStore, words: str
) -> None:
    world.client.command(54000, 1, 0, 0, 1, 0, 8, 5)
    world.run(0.1)
    before = world.task(1).terms
    store.delay = inf
    ask(world, words)
    world.run(0.2)
    ask(world, words)  # it repeats it
    world.run(0.5)
    store.delay = 0.0
    world.run(0.1)
    refused = (TEMPORARILY_REJECTED, R.STORE_UNAVAILABLE)
    assert (world.client.acks_of(54012), world.task(1).terms) == ([refused] * 2, before)
    store.delay = 0.2
    ask(world, words)
    world.run(0.1)
    assert len(world.client.acks_of(54012)) == 2
    world.run(0.2)
    assert world.client.acks_of(54012)[2:] == [(ACCEPTED, 1)]
    assert world.task(1).terms != before


PLAN = "; ".join(
    ["mission", *(f"NAV_WAYPOINT at={each}" for each in ("0,0", "9,0", "9,9", "0,-9"))]
)


@for_each("words", ["DO_CHANGE_SPEED 1 0.1", "DO_SET_MISSION_CURRENT 3 to=autopilot"])
def test_a_refused_change_drives_nothing(world: World, store: LateStore, words: str) -> None:
    ask(world, PLAN)
    world.run(1)
    ask(world, "MISSION_START")
    world.until_faster(0.4)
    store.delay = inf
    ask(world, words)
    world.run(0.2)
    ask(world, words)  # it repeats it
    world.run(0.3)
    assert world.truth.forward_speed < 0.25  # slower at once, or not to another item
    assert world.client.texts()[-2:] == ["not stored in time: nothing changed"] * 2
    store.delay = 0.0
    world.until_faster(0.4)
    assert world.truth.north > 0.3
    assert abs(world.truth.east) < 0.1
    store.delay, answered = 0.2, len(world.client.acks)
    ask(world, words)
    world.run(0.15)
    assert len(world.client.acks) == answered
    world.run(0.1)
    assert world.client.acks[-1].result == ACCEPTED


@for_each("halt", ["pause", "delay"])
def test_a_refused_start_lets_nothing_go(world: World, store: LateStore, halt: str) -> None:
    ask(world, PLAN)
    world.run(1)
    ask(world, "MISSION_START")
    world.until_faster(0.3)
    if halt == "pause":
        world.client.pause()
    else:
        world.observer.expects_gaps = True
        world.suspend_server(2.0)
    world.run(4)
    assert world.state(1)[0] is (S.PAUSED if halt == "pause" else S.HELD)
    store.delay = inf
    world.client.command(300, 3)
    world.run(1)
    assert world.client.said("not stored in time: not started")
    store.delay = 0.0
    world.run(4)
    assert (world.states(), world.paused()) == ([S.PAUSED], R.OPERATOR)
    assert world.task(1).progress.step == 1
    assert world.stands()
    ask(world, "MISSION_START")
    world.until_faster(0.3)


def test_what_repeats_by_a_refused_change_has_no_further_run(
    world: World, store: LateStore
) -> None:
    world.client.command(54000, 1, 0, 0, 1, 0, 8, 5)
    world.run(0.1)
    store.delay = inf
    ask(world, "TASK_MODIFY 1 9 15")
    ask(world, "TASK_CANCEL 1")
    world.run(0.1)
    assert world.states() == [S.CANCELLED, S.SCHEDULED]  # the next run
    world.run(0.5)
    assert world.states() == [S.CANCELLED, S.CANCELLED]
