"""One command to the rover or its camera, as a task: told once, and done when it is accepted."""

from math import inf, nan
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks import Act
from mav_tasks.config.settings import Queueing, Settings
from mav_tasks.tasks.events import VehicleNoted
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import NO_FAULTS, Faults
from tests.kit.cases import anew, for_each
from tests.kit.client import ACCEPTED, FAILED, packed
from tests.kit.restarts import UTC, restart
from tests.kit.rows import check, item
from tests.kit.store import PromptSqliteStore
from tests.kit.world import World, is_at
from tests.scenarios.conftest import MakeWorld

RELAY, COMMAND_ACK = 181, 77
IN_PROGRESS = 5
RELEASE, AGAIN, REMAINDER, SKIP = 54013, 0, 1, 2
TOLD = "TASK_ACT 1 5; DO_SET_RELAY 0 1 0 0 frame=2"
UNANSWERED = Faults(withheld=frozenset({COMMAND_ACK}))


@anew
def world(make_world: MakeWorld, path: Path) -> World:
    return make_world(store=PromptSqliteStore(path, wall_offset=UTC), settings=Settings())


def upload(world: World, plan: str) -> int:
    """Upload a plan to the task server; return its id."""
    sent = world.upload([item(each) for each in plan.split("; ")], target=(1, 191))
    assert sent.result == ACCEPTED, world.client.texts()
    return int(sent.opaque_id)


def times_told(world: World) -> int:
    return world.observer.sent_since(0).count(str(RELAY))


def told_without_an_answer(world: World, faults: Faults = UNANSWERED) -> int:
    world.fault(faults)
    task = upload(world, TOLD)
    world.until(lambda: times_told(world) == 1, within=10.0)
    return task


def say(world: World, result: int) -> None:
    """Let the rover answer a command to its relay."""
    ack = common.MAVLink_command_ack_message(RELAY, result)
    world.from_vehicle_side(packed(ack, 1, 1, seq=200), peer="rover1")


def test_it_is_told_once_between_two_drives_while_the_rover_stands(world: World) -> None:
    seen: list[Any] = []

    def look(_now: float) -> None:
        if len(seen) < times_told(world):
            seen.append((world.truth.north, world.truth.forward_speed))

    world.watch(look)
    task = upload(world, f"NAV_WAYPOINT at=1,0; {TOLD}; NAV_WAYPOINT at=2,0")
    world.until_state(task, S.COMPLETED)
    assert seen == [(pytest.approx(1.0, abs=0.1), pytest.approx(0.0, abs=0.02))]
    assert is_at(world, 2.0, 0.0)


@for_each(
    "faults, plan, reason, words",
    [
        (NO_FAULTS, "TASK_ACT; DO_SET_RELAY 9 1 0 0 frame=2", R.REFUSED, "of task 1: FAILED"),
        (UNANSWERED, TOLD, R.NO_ANSWER, "did not answer command 181 of task 1"),
        (
            NO_FAULTS,
            "TASK_ACT 100; DO_SET_SERVO 1 1700 0 0 frame=2",  # no such component: ArduPilot answers
            R.REFUSED,
            "FAILED, ServoRelayEvent: Channel 1 is already in use",
        ),
    ],
)
def test_it_fails_with_the_rovers_own_result(
    world: World, faults: Faults, plan: str, reason: R, words: str
) -> None:
    world.client.pause()
    task = upload(world, plan)
    world.client.proceed()
    world.until_state(task, S.STARTING)
    world.until_state(task, S.EXECUTING)
    world.fault(faults)
    world.until_state(task, S.FAILED)
    assert world.state(task) == (S.FAILED, reason)
    assert words in world.events(VehicleNoted)[-1].text
    told = [n for n in world.observer.sent_since(0) if n in ("181", "183")]
    assert len(told) == 1


@for_each("how", [AGAIN, REMAINDER, SKIP])
def test_after_a_crash_it_is_not_told_again_but_held(world: World, path: Path, how: int) -> None:
    task = told_without_an_answer(world)
    restart(world, path)
    world.fault(NO_FAULTS)
    world.run(5.0)
    assert world.state(task) == (S.HELD, R.OUTCOME_UNKNOWN)
    assert times_told(world) == 1
    sent = world.client.command(RELEASE, task, how)
    world.client.proceed()
    world.run(10.0)
    assert sent.answer == (ACCEPTED, task)
    assert world.state(task) == ((S.CANCELLED, R.SKIPPED) if how == SKIP else (S.COMPLETED, R.NONE))
    assert times_told(world) == (1 if how == SKIP else 2)


@for_each("answers, after", [(True, "COMPLETED NONE"), (False, "HELD OUTCOME_UNKNOWN")])
def test_a_pause_before_its_answer_keeps_what_is_known(
    world: World, answers: bool, after: str
) -> None:
    told_without_an_answer(world, NO_FAULTS if answers else UNANSWERED)
    check(
        world,
        f"""
PAUSE & wait 8 & fault & wait 0 : ACCEPTED
CONTINUE & wait 5 : ACCEPTED task 1: {after}
""",
    )
    assert times_told(world) == 1


def test_the_answer_counts_also_if_another_task_goes_first_meanwhile(make_world: MakeWorld) -> None:
    world = make_world(settings=Settings(queueing=Queueing(preemption_gap=2)))
    task = told_without_an_answer(world)
    other = upload(world, "NAV_WAYPOINT at=1,0; TASK_OPTIONS 10 frame=2")
    world.until_state(other, S.EXECUTING)
    say(world, ACCEPTED)
    world.run(15.0)
    assert [world.state(each)[0] for each in (task, other)] == [S.COMPLETED] * 2
    assert times_told(world) == 1


def test_what_waits_to_be_told_is_not_told_once_it_is_cancelled(world: World) -> None:
    """A client's own command goes first."""
    world.fault(UNANSWERED)
    world.client.pause()
    task = upload(world, TOLD)
    check(world, "CONTINUE & until 1 EXECUTING & DO_SET_RELAY 5 1 to=autopilot & wait 0 : ACCEPTED")
    world.until(lambda: world.task(task).progress.done > 0.0, within=10.0)
    check(world, "TASK_CANCEL 1 : ACCEPTED+BUSY\nwait 12 : - task 1: CANCELLED")
    assert times_told(world) == 1


def test_what_comes_before_it_in_a_plan_is_done_before_it(world: World) -> None:
    first = "DO_SET_SERVO 9 1500 0 0 frame=2; CONDITION_DELAY 3 0 0 0 frame=2; DO_GRIPPER frame=2"
    world.until_state(upload(world, f"{first}; {TOLD}"), S.COMPLETED)
    told = [name for name in world.observer.sent_since(0) if name in ("181", "183", "211")]
    assert told == ["183", "211", "181"]


def test_a_stop_ends_it(world: World) -> None:
    told_without_an_answer(world)
    check(world, "TASK_STOP & wait 8 : ACCEPTED task 1: KILLED STOP")
    assert times_told(world) == 1


def test_what_may_move_the_rover_or_is_no_command_is_refused(world: World) -> None:
    check(
        world,
        """
plan; TASK_ACT; DO_SET_MODE 1 END : UNSUPPORTED is not for a plan: the server starts, stops and arms
plan; TASK_ACT; DO_MOTOR_TEST 1 END : UNSUPPORTED never on the way
plan; TASK_ACT; DO_REPOSITION 1 END : UNSUPPORTED see 16
plan; TASK_ACT; NAV_WAYPOINT at=1,0 : INVALID TASK_ACT is about the next item
plan; NAV_WAYPOINT at=1,0; TASK_ACT : INVALID item 2: TASK_ACT is about the next item
plan; TASK_ACT 256; DO_SET_RELAY 0 1 END : INVALID_PARAM1 component 256 not in 0..255
plan; TASK_ACT 1 601; DO_SET_RELAY 0 1 END : INVALID_PARAM2 time limit 601 not in 0..600
plan; TASK_ACT; DO_SET_RELAY 0 1 END; DO_JUMP 0 -1 END : INVALID a loop without motion
""".replace("END", "0 0 0 frame=2"),
    )


@for_each(
    "value, at, kind", [(nan, 1, "a"), (inf, 7, "a"), (inf, 5, "a whole"), (0.5, 6, "a whole")]
)
def test_a_parameter_that_cannot_be_sent_is_named(value: float, at: int, kind: str) -> None:
    params = tuple(value if index == at else 0.0 for index in range(1, 8))
    with pytest.raises(ValueError, match=rf"param{at} \S+ is not {kind} number"):
        assert Act(RELAY, params).sent


def test_an_act_has_time_as_long_as_the_rover_says_that_it_goes_on(world: World) -> None:
    task = told_without_an_answer(world)
    for _ in range(4):
        world.run(2.5)
        say(world, IN_PROGRESS)
    world.run(2.5)
    assert world.state(task) == (S.EXECUTING, R.NONE)
    say(world, ACCEPTED)
    world.until_state(task, S.COMPLETED, within=1.0)
    assert times_told(world) == 1


@for_each("end", [ACCEPTED, FAILED])
def test_the_answer_to_an_act_that_was_cancelled_is_not_that_to_the_next(
    world: World, end: int
) -> None:
    first = told_without_an_answer(world)
    world.client.command(54010, first)
    second = upload(world, TOLD.replace("0", "1"))
    for _ in range(2):
        world.run(2.0)
        say(world, IN_PROGRESS)
    world.run(2.0)
    assert times_told(world) == 1
    say(world, end)
    world.run(1.0)
    assert (times_told(world), world.state(second)[0]) == (2, S.EXECUTING)
    say(world, ACCEPTED)
    world.until_state(second, S.COMPLETED, within=1.0)
