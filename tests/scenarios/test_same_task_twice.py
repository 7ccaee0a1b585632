"""A command that comes again, by a lost ack or by intention: protocol.md section 4."""

import pytest

from mav_tasks.config.settings import Queueing, Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import anew, for_each
from tests.kit.rows import check
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

REPEATED = "repeated command, no new task: see task 1"


@anew
def paused(world: World) -> World:
    """A world in which tasks only pile up."""
    world.client.pause()
    world.run(0.1)
    return world


def test_the_very_same_packet_gets_the_same_answer(paused: World) -> None:
    check(
        paused,
        """
TASK_MOVE 1 & wait 0.05 : ACCEPTED #1
TASK_MOVE 2 & wait 0.1 & again & wait 0.4 & again & wait 3 & again : ACCEPTED+ACCEPTED+ACCEPTED+OK
""".replace("OK", "ACCEPTED #2 / !#1"),
    )
    assert len(paused.tasks()) == 2


def test_a_nonce_names_a_task_for_good(paused: World) -> None:
    check(
        paused,
        f"""
TASK_MOVE 1 0 0 5 & wait 30 : ACCEPTED #1
TASK_MOVE 1 0 0 5 : ACCEPTED #1
TASK_MOVE 2 0 0 5 : DENIED #{R.NONCE_REUSED}
TASK_MOVE 1 0 0 6 : ACCEPTED #2
""",
    )


def test_a_nonce_counts_from_another_port_of_the_same_address_too(paused: World) -> None:
    check(
        paused,
        """
TASK_MOVE 1 0 0 5 : ACCEPTED #1
elsewhere> TASK_MOVE 1 0 0 5 : ACCEPTED #1
stranger> TASK_MOVE 1 0 0 5 : ACCEPTED #2
""",
        elsewhere=paused.add_client("elsewhere"),
        stranger=paused.add_client("stranger", system_id=7),
    )


@for_each("after, task_id", [(2.4, 1), (9.9, 1), (10.1, 2)])
def test_confirmation_above_0_is_a_repeat_for_10_s(
    paused: World, after: float, task_id: int
) -> None:
    again = f"TASK_MOVE 1 confirmation=1 : ACCEPTED #{task_id}"
    check(paused, f"TASK_MOVE 1 & wait {after} : ACCEPTED\n{again}")


@for_each("after, told", [(2.4, f"#1 / {REPEATED}, queued"), (2.6, f"#2 / !{REPEATED}")])
def test_an_equal_payload_is_a_repeat_for_2_5_s(paused: World, after: float, told: str) -> None:
    check(paused, f"TASK_MOVE 1 & wait {after} : ACCEPTED\nTASK_MOVE 1 : ACCEPTED {told}")


def test_a_b_a_is_three_tasks_if_b_is_the_same_command(paused: World) -> None:
    check(
        paused,
        """
TASK_MOVE 1 : ACCEPTED #1
TASK_MOVE 2 : ACCEPTED #2
TASK_MOVE 1 : ACCEPTED #3
""",
    )


def test_what_was_refused_can_be_tried_again_at_once(make_world: MakeWorld) -> None:
    check(
        make_world(settings=Settings(queueing=Queueing(capacity=1))),
        f"""
TASK_STOP : ACCEPTED
TASK_MOVE 1 : ACCEPTED
TASK_ROTATE 20 : BUSY #{R.QUEUE_FULL}
CONTINUE & idle 1 : ACCEPTED
TASK_ROTATE 20 : ACCEPTED #2
""",
    )


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
