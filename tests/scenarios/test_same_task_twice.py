"""A command that comes again, by a lost ack or by intention: protocol.md section 4."""

import pytest

from mav_tasks.config.settings import Queueing, Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import anew, for_each
from tests.kit.client import (
    ACCEPTED,
    DENIED,
    MOVE,
    TEMPORARILY_REJECTED,
    command_long,
)
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld


@anew
def paused(world: World) -> World:
    """A world in which tasks only pile up."""
    world.client.pause()
    world.run(0.1)
    return world


def test_the_very_same_packet_gets_the_same_answer(paused: World) -> None:
    paused.client.move(1)
    paused.run(0.05)
    packet = paused.client.send(command_long(MOVE, 2.0))
    for pause in (0.1, 0.4, 3.0):
        paused.run(pause)
        paused.client.send_raw(packet)
    paused.run(0.1)
    assert paused.client.acks_of(MOVE) == [(ACCEPTED, 1)] + [(ACCEPTED, 2)] * 4
    assert len(paused.tasks()) == 2


def test_a_nonce_names_a_task_for_good(paused: World) -> None:
    first = paused.client.move(1, nonce=5)
    paused.run(30)
    again = paused.client.move(1, nonce=5)
    paused.run(0.1)
    other = paused.client.move(2, nonce=5)
    paused.run(0.1)
    fresh = paused.client.move(1, nonce=6)
    paused.run(0.1)
    assert [s.answer for s in (first, again, other, fresh)] == [
        (ACCEPTED, 1),
        (ACCEPTED, 1),
        (DENIED, R.NONCE_REUSED),
        (ACCEPTED, 2),
    ]


def test_a_nonce_counts_from_another_port_of_the_same_address_too(paused: World) -> None:
    first = paused.client.move(1, nonce=5)
    paused.run(0.1)
    elsewhere = paused.add_client("elsewhere")
    again = elsewhere.move(1, nonce=5)
    stranger = paused.add_client("stranger", system_id=7)
    own = stranger.move(1, nonce=5)
    paused.run(0.1)
    assert [s.task_id for s in (first, again, own)] == [1, 1, 2]


@for_each("after, task_id", [(2.4, 1), (9.9, 1), (10.1, 2)])
def test_confirmation_above_0_is_a_repeat_for_10_s(
    paused: World, after: float, task_id: int
) -> None:
    paused.client.move(1)
    paused.run(after)
    again = paused.client.move(1, confirmation=1)
    paused.run(0.1)
    assert again.task_id == task_id


@for_each("after, task_id", [(2.4, 1), (2.6, 2)])
def test_an_equal_payload_is_a_repeat_for_2_5_s(paused: World, after: float, task_id: int) -> None:
    paused.client.move(1)
    paused.run(after)
    again = paused.client.move(1)
    paused.run(0.1)
    assert again.task_id == task_id
    told = [text for text in paused.client.texts() if "repeated command" in text]
    assert told == ["repeated command, no new task: see task 1, queued"] * (2 - task_id)


def test_a_b_a_is_three_tasks_if_b_is_the_same_command(paused: World) -> None:
    ids = []
    for distance in (1.0, 2.0, 1.0):
        sent = paused.client.move(distance)
        paused.run(0.1)
        ids.append(sent.task_id)
    assert ids == [1, 2, 3]


def test_what_was_refused_can_be_tried_again_at_once(make_world: MakeWorld) -> None:
    world = make_world(settings=Settings(queueing=Queueing(capacity=1)))
    world.client.stop()
    world.run(0.5)
    world.client.move(1)
    world.run(0.1)
    refused = world.client.rotate(20)
    world.run(0.1)
    assert refused.answer == (TEMPORARILY_REJECTED, R.QUEUE_FULL)
    world.client.proceed()
    world.until_idle(tasks=1)
    again = world.client.rotate(20)
    world.run(0.1)
    assert again.answer == (ACCEPTED, 2)


def test_each_command_is_answered_once_in_time_and_never_later(world: World) -> None:
    sent = [
        world.client.move(0.3),
        world.client.rotate(10),
        world.client.pause(),
        world.client.request_status(1),
        world.client.request_status(99),
        world.client.command(54001, float("inf")),
        world.client.command(54002, 1, 0, 1),
        world.client.command(31000, target=(1, 1)),
        world.client.command(31010, target=(1, 191)),
        world.client.command(512, 300, target=(1, 1)),
        world.client.arm(),
    ]
    world.run(20)
    at = {s.message.command: s.at for s in sent}
    assert len(world.client.acks) == len(sent)
    assert all(s.acked_at - at[s.message.command] <= 0.5 for s in sent)
    assert all(ack.result <= 4 for ack in world.client.acks)


# nonces


NONCE = 5


KEPT = 600.0  # s after its end, in which a task is known by its nonce


def done(world: World) -> int:
    task = world.client.move(0.5, nonce=NONCE)
    world.run(0.2)
    world.until_state(task.task_id, S.COMPLETED)
    return task.task_id


def test_an_old_nonce_does_not_swallow_an_equal_task(world: World) -> None:
    first = done(world)
    world.run(KEPT + 1.0)
    before = world.truth.north
    assert done(world) == first + 1
    assert world.truth.north - before == pytest.approx(0.5, abs=0.05)
