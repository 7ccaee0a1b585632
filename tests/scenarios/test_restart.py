"""A server ends, well or not, and another one goes on from what it had stored."""

from pathlib import Path

import pytest

from mav_tasks.config.settings import Queueing, Settings
from mav_tasks.engine.inputs import Shutdown
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode
from tests.kit.cases import anew, for_each
from tests.kit.client import ACCEPTED, MOVE, RTL
from tests.kit.mission import Download, reached
from tests.kit.restarts import UTC, restart
from tests.kit.rows import check
from tests.kit.store import PromptSqliteStore
from tests.kit.world import OFF, World, is_at, near_pose
from tests.scenarios.conftest import MakeWorld

VERSION = 148  # AUTOPILOT_VERSION
RELEASE, AGAIN, REMAINDER, SKIP = 54013, 0, 1, 2


@anew
def world(make_world: MakeWorld, path: Path) -> World:
    store = PromptSqliteStore(path, wall_offset=UTC)
    settings = Settings(queueing=Queueing(preemption_gap=3, preemption_rest=0.3))
    return make_world(store=store, settings=settings)


def in_mode(world: World) -> Mode:
    return world.mode()


def release(world: World, task: int, how: int) -> tuple[int, int] | None:
    sent = world.client.command(RELEASE, task, how)
    world.run(0.1)
    return sent.answer


def test_what_ran_is_held_and_the_rover_is_put_to_hold(world: World, path: Path) -> None:
    world.client.move(3)
    world.run(0.1)
    for number in range(3):
        world.client.move(0.2 + number / 10, priority=5 + number)
        world.run(0.1)
    world.run(3)
    before = [(t.id, t.goal, t.terms, t.state) for t in world.tasks() if t.id != 1]
    assert in_mode(world) == Mode.GUIDED
    restart(world, path)
    assert world.state(1) == (S.HELD, R.OUTCOME_UNKNOWN)
    assert in_mode(world) == Mode.HOLD
    kept = world.shown(1)  # of the second in which the server was killed, or before
    assert 0.5 < 3.0 - kept.remaining <= world.pose()[0]
    assert kept.progress == pytest.approx(100 * (3.0 - kept.remaining) / 3.0, abs=15), "by time"
    assert world.paused() is R.RESTARTED
    assert [(t.id, t.goal, t.terms, t.state) for t in world.tasks() if t.id != 1] == before
    where = world.pose()
    world.run(5)
    assert world.pose() == where


@for_each("how", [AGAIN, REMAINDER, SKIP])
def test_a_held_task_is_released_and_the_rest_goes_on(world: World, path: Path, how: int) -> None:
    world.client.move(5.0)
    world.run(0.1)
    world.client.rotate(90)
    world.run(3)
    restart(world, path)
    driven = world.pose()[0]
    assert 1.5 < driven < 4
    assert release(world, 1, how) == (ACCEPTED, 1)
    proceeded = world.client.proceed()
    world.until_idle(tasks=2)
    assert proceeded.result == ACCEPTED
    end = {AGAIN: driven + 5.0, REMAINDER: 5.0, SKIP: driven}[how]
    assert near_pose(world.pose(), (end, 0.0, 90.0))
    assert world.state(1) == ((S.CANCELLED, R.SKIPPED) if how == SKIP else (S.COMPLETED, R.NONE))


def test_one_continue_is_enough_if_an_immediate_return_is_skipped(world: World, path: Path) -> None:
    world.client.move(5)
    world.run(4)
    world.client.mode(RTL)
    world.until_state(2, S.EXECUTING)
    restart(world, path)
    assert [world.state(i)[0] for i in (1, 2)] == [S.PAUSED, S.HELD]
    world.client.proceed()
    world.run(1)
    assert release(world, 2, SKIP) == (ACCEPTED, 2)
    world.until_state(1, S.COMPLETED)


def test_a_return_that_was_paused_is_resumed_first(world: World, path: Path) -> None:
    world.client.move(5)
    world.run(6)
    world.client.mode(RTL)
    world.until_state(2, S.EXECUTING)
    world.client.pause()
    world.run(2)
    restart(world, path)
    assert [world.state(i)[0] for i in (1, 2)] == [S.PAUSED, S.PAUSED]
    world.client.proceed()
    world.until_state(2, S.COMPLETED)
    assert world.state(1)[0] is not S.COMPLETED


def test_what_was_paused_or_interrupted_stays_so_and_ends_where_it_should(
    world: World, path: Path
) -> None:
    check(
        world,
        """
TASK_MOVE 2 0 0 0 0 0 1 & wait 3 : ACCEPTED
TASK_ROTATE 90 0 0 0 0 0 8 & until 2 EXECUTING : ACCEPTED
wait 0.5 & PAUSE & wait 2 : ACCEPTED
""",
    )
    restart(world, path)
    check(
        world,
        """
wait 0 : - task 1: PAUSED PREEMPTED / task 2: PAUSED OPERATOR / queue OPERATOR
CONTINUE & idle 2 : ACCEPTED task 1: COMPLETED / task 2: COMPLETED / at=2,0,0
""",
    )


def test_a_rover_that_restarted_meanwhile_does_not_resume_an_old_line(
    world: World, path: Path
) -> None:
    check(world, "TASK_MOVE 2 & wait 3 : ACCEPTED\nPAUSE & wait 3 & reboot & wait 0 : ACCEPTED")
    restart(world, path, well=True, away=8.0)
    check(
        world, "operator hold & wait 1 : -\nCONTINUE & wait 1 : ACCEPTED task 1: HELD FRAME_RESET"
    )


@for_each("is_restarted", [False, True])
def test_a_rover_that_somebody_disarmed_is_armed_only_after_continue(
    world: World, path: Path, *, is_restarted: bool
) -> None:
    check(
        world,
        "TASK_MOVE 2 & wait 3 : ACCEPTED\noperator disarms & wait 1 & operator hold & wait 1 : -",
    )
    if is_restarted:
        restart(world, path)
    check(
        world,
        f"""
DO_SET_MODE 1 11 to=autopilot & wait 2 : BUSY #{R.DISARMED} / it is DISARMED
CONTINUE & until 1 COMPLETED : ACCEPTED
""",
    )


@for_each("answers_lost", [0, 1, 1000])
def test_another_rover_of_the_same_id_runs_nothing_unasked(
    world: World, path: Path, answers_lost: int
) -> None:
    """After an evening with the simulated one, say: each rover's system id is 1 when it is new."""
    world.client.command(MOVE, 2.0, 0, 0, 0, 0, 15.0)
    world.run(0.5)
    world.server.engine.handle(Shutdown(), now=world.now)
    world.run(1.0)
    world.replace_rover(switched_on=world.now)
    left = [answers_lost]

    def loses(source: str, _target: str, data: bytes) -> bool:
        is_lost = source == "rover1" and data[7] == VERSION and left[0] > 0
        left[0] -= is_lost
        return is_lost

    world.watched.loses = loses
    restart(world, path, well=True)
    world.run(40)
    assert (world.truth.north, world.truth.forward_speed) == (0.0, 0.0)
    assert (world.state(1)[0], world.paused()) == (S.QUEUED, R.RESTARTED)


@for_each("idle, paused", [(60.0, R.NONE), (700.0, R.RESTARTED)])
def test_after_a_good_end_waiting_tasks_go_on_unless_it_was_long_ago(
    world: World, path: Path, idle: float, paused: R
) -> None:
    world.client.command(MOVE, 0.5, 0, 0, 0, 0, 30, 5)
    world.run(1)
    restart(world, path, well=True, away=0.0, settles=1.0, utc=UTC + idle)
    assert world.paused() is paused
    if paused is R.NONE:
        world.until_idle(tasks=1)  # its time has come while nobody looked
        assert world.state(1)[0] is S.COMPLETED


def test_plans_and_the_fence_are_kept(world: World, path: Path) -> None:
    check(
        world,
        """
mission; NAV_WAYPOINT frame=0 current=1; NAV_WAYPOINT at=1,0; NAV_WAYPOINT at=1,1 : ACCEPTED
fence; IN 4 0 0 0 at=-3,-3; IN 4 0 0 0 at=3,-3; IN 4 0 0 0 at=3,3; IN 4 0 0 0 at=-3,3 : ACCEPTED
""",
    )
    restart(world, path, well=True)
    check(world, f"DO_REPOSITION -1 at=5,0 frame=0 : DENIED #{R.OUTSIDE_FENCE}")
    download = Download(world.client)
    world.until(lambda: download.is_done, within=5)
    assert (download.count, download.opaque_id) == (3, 1)
    world.client.command(300, target=(1, 1))
    world.until_state(1, S.COMPLETED, within=60)
    assert is_at(world, 1, 1)


def test_a_plan_goes_on_with_the_item_that_was_driven(world: World, path: Path) -> None:
    check(world, "plan; NAV_WAYPOINT at=1,0; NAV_WAYPOINT at=3,0; NAV_WAYPOINT at=3,2 : ACCEPTED")
    world.until(lambda: reached(world.client) == [0], within=20)
    world.run(1)
    restart(world, path)
    assert world.state(1) == (S.HELD, R.OUTCOME_UNKNOWN)
    assert release(world, 1, REMAINDER) == (ACCEPTED, 1)
    world.client.proceed()
    world.until_state(1, S.COMPLETED, within=60)
    assert reached(world.client) == [0, 1, 2]
    assert is_at(world, 3, 2)


@for_each("is_frame_lost", [False, True])
def test_the_remainder_after_an_orderly_end_is_right_within_5_cm(
    world: World, path: Path, is_frame_lost: bool
) -> None:
    world.client.move(8, speed=1.0)
    world.until(lambda: world.truth.north > 3.0, within=15)
    began = world.now
    world.server.pump.handle(Shutdown(), now=world.now)
    world.until(lambda: world.server.pump.is_over, within=3.1)
    assert abs(world.truth.forward_speed) < 0.1
    assert world.now - began > 1.0  # from 1 m/s it cannot stand sooner
    if is_frame_lost:
        world.rover.autopilot.reboot(now=world.now)
    restart(world, path, well=True)
    world.client.proceed()
    world.run(0.3)
    if is_frame_lost:
        assert world.state(1) == (S.HELD, R.FRAME_RESET)
        assert release(world, 1, REMAINDER) == (ACCEPTED, 1)
        world.client.proceed()
    world.until_idle(tasks=1)
    assert world.truth.north == pytest.approx(8.0, abs=OFF)
