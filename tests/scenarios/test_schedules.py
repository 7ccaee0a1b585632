"""Tasks that repeat: a day of runs, crashes, STOP, outages, clocks that are set."""

from pathlib import Path

import pytest

from mav_tasks.config.settings import Settings
from mav_tasks.engine.inputs import WallClock
from mav_tasks.mavlink.label import text_pieces
from mav_tasks.tasks.events import VehicleNoted
from mav_tasks.tasks.lifecycle import TERMINAL, WAITING
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import Task
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, DENIED, Sent
from tests.kit.restarts import UTC, restart
from tests.kit.rows import check
from tests.kit.store import PromptSqliteStore
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

CANCEL, MODIFY = 54010, 54012
EVERY, REPEAT = 9, 10
HOUR, DAY = 3600, 86_400
GOES_ON = Settings(on_restart="continue")


def submit(world: World, distance: float = 0.2, *, delay: float = DAY) -> int:
    sent = world.client.command(54000, distance, 0, 0, 0, 0, delay, 5)
    world.run(0.05)
    return sent.task_id


def every(world: World, period: float, *, distance: float = 0.2, delay: float = 0.0) -> int:
    """Submit a move that repeats; return its id."""
    task = submit(world, distance, delay=delay)
    asked = world.client.command(MODIFY, task, EVERY, period)
    world.run(0.05)
    assert asked.answer == (ACCEPTED, task)
    return task


def cron(world: World, text: str, task: int) -> Sent:
    """Let a task repeat at the times of an expression; return the last piece sent."""
    for piece in text_pieces(text):
        sent = world.client.command_int(
            MODIFY, task, REPEAT, piece.offset, len(text), x=piece.x, y=piece.y, frame=0
        )
        world.run(0.05)
    return sent


def set_clock(world: World, utc: float) -> None:
    world.server.pump.handle(WallClock(utc - world.now), now=world.now)
    world.server.pump.turn(now=world.now)


def runs(world: World) -> list[Task]:
    """Return the runs of all series, in the order in which they were made."""
    return sorted((task for task in world.tasks() if task.terms.series), key=lambda task: task.id)


def waiting(world: World) -> list[Task]:
    return [task for task in runs(world) if task.state in WAITING]


def noted(world: World) -> list[str]:
    texts = [event.text for event in world.events(VehicleNoted)]
    return [text for text in texts if "left out" in text or "will not repeat" in text]


def check_each_series_once(world: World) -> None:
    live = [task.terms.series for task in runs(world) if task.state not in TERMINAL]
    assert len(live) == len(set(live)), runs(world)


def test_runs_follow_each_other_without_drift_and_each_is_a_task(world: World) -> None:
    task = every(world, 60)
    began = world.task(task).submitted_at
    world.run(10 * 60 - 5)
    made = runs(world)
    assert [each.state for each in made] == [*[S.COMPLETED] * 10, S.SCHEDULED]
    assert [each.terms.start_at for each in made] == pytest.approx(
        [began + 60 * number for number in range(11)], abs=1e-6
    )
    assert {each.terms.series for each in made} == {task}
    assert {(each.goal, each.submitter) for each in made} == {(made[0].goal, made[0].submitter)}
    assert noted(world) == []


def test_a_cron_expression_sets_the_start_by_the_wall_clock(world: World) -> None:
    set_clock(world, UTC)
    task = submit(world)
    sent = cron(world, "0 9 * * 1-5 Europe/Zurich", task)
    assert sent.answer == (ACCEPTED, task)
    assert world.task(task).terms.start_utc == UTC + 3 * DAY  # a Monday; 09:00 there is 08:00 UTC
    assert world.task(task).state is S.SCHEDULED
    set_clock(world, UTC + 3 * DAY)
    world.until_state(task, S.COMPLETED, within=20)
    world.run(0.1)
    (following,) = waiting(world)
    assert following.terms.start_utc == UTC + 4 * DAY


@for_each(
    "text, words",
    [("61 9 * * *", "bad minute"), ("0 9 * * * Mars/X", "time zone"), ("0 9 30 2 *", "day-of-m")],
)
def test_an_invalid_expression_changes_nothing(world: World, text: str, words: str) -> None:
    task = submit(world)
    before = world.task(task).terms
    sent = cron(world, text, task)
    assert sent.answer == (DENIED, R.BAD_PARAMETER)
    assert world.client.said(words)
    assert world.task(task).terms == before


def test_cancel_ends_one_run_and_the_series_goes_on(world: World) -> None:
    task = every(world, 60, delay=30)
    start = world.task(task).terms.start_at
    assert start is not None
    world.client.command(CANCEL, task)
    world.run(0.1)
    assert world.state(task) == (S.CANCELLED, R.CANCELLED)
    (following,) = waiting(world)
    assert following.terms.start_at == start + 60  # not the one that was cancelled
    driven = following.id
    world.until_state(driven, S.EXECUTING, within=100)
    world.client.command(CANCEL, 0)
    world.until_state(driven, S.CANCELLED)
    world.run(0.1)
    assert [each.terms.start_at for each in waiting(world)] == [start + 120]


@for_each("named", ["first", "present"])
def test_cancelling_the_series_ends_it_by_the_id_of_any_run(world: World, named: str) -> None:
    task = every(world, 20)
    world.run(45)
    present = waiting(world)[0].id
    check(
        world,
        f"""
TASK_CANCEL {task if named == "first" else present} 0 1 : ACCEPTED #{present} / \
task {present}: CANCELLED CANCELLED
wait 60 : -
TASK_CANCEL {task} 0 1 : DENIED #{R.WRONG_STATE}
""",
    )
    assert waiting(world) == []


@for_each("state", [S.SCHEDULED, S.EXECUTING])
def test_a_stop_ends_every_series_of_its_rover(world: World, state: S) -> None:
    """Hours after it, and long after a resume, nothing may start by itself."""
    task = every(world, 30, distance=2.0, delay=10 if state is S.SCHEDULED else 0)
    world.until_state(task, state)
    check(world, f"TASK_STOP & wait 5 : ACCEPTED task {task}: KILLED STOP")
    assert noted(world)[-1] == f"will not repeat task {task}: STOP"
    count = len(world.tasks())
    check(world, "CONTINUE & wait 120 : ACCEPTED")
    assert len(world.tasks()) == count
    assert waiting(world) == []


# restarts


@for_each("away", [20.0, 200.0])
def test_times_that_passed_in_an_outage_are_left_out(
    make_world: MakeWorld, path: Path, away: float
) -> None:
    """One late run, if no other is due; else the next planned time, and a text."""
    world = make_world(store=PromptSqliteStore(path, wall_offset=UTC), settings=GOES_ON)
    task = every(world, 40)
    world.until_state(task, S.COMPLETED)
    (before,) = waiting(world)
    start = before.terms.start_at
    assert start is not None
    world.run(start - world.now - 10.0)
    restart(world, path, away=away)
    if away < 40:
        world.until_state(before.id, S.COMPLETED, within=10)
        assert noted(world) == []
        assert [each.terms.start_at for each in waiting(world)] == [pytest.approx(start + 40)]
        return
    (after,) = waiting(world)
    assert after.id == before.id
    assert after.terms.start_at == pytest.approx(start + 200)
    assert "left out 5 runs that passed meanwhile; task 2 starts 2027-01-15 08:0" in noted(world)[0]
    world.until_state(before.id, S.COMPLETED, within=60)


def test_a_run_that_was_driven_at_a_crash_is_held_and_the_series_waits_for_it(
    make_world: MakeWorld, path: Path
) -> None:
    world = make_world(store=PromptSqliteStore(path, wall_offset=UTC), settings=GOES_ON)
    task = every(world, 20, distance=3.0)
    world.run(3)
    restart(world, path)
    check(world, f"wait 40 : - task {task}: HELD OUTCOME_UNKNOWN")
    assert [each.id for each in runs(world)] == [task]
    check(world, f"TASK_RELEASE {task} 2 : ACCEPTED task {task}: CANCELLED SKIPPED")
    assert len(waiting(world)) == 1


# clocks


def test_a_clock_that_is_set_back_far_counts_from_now_and_a_little_does_not(world: World) -> None:
    set_clock(world, UTC)
    submit(world)
    cron(world, "0 * * * *", 1)
    set_clock(world, UTC + HOUR)
    world.until_state(1, S.COMPLETED, within=20)
    world.run(0.1)
    (following,) = waiting(world)
    assert following.terms.start_utc == UTC + 2 * HOUR
    set_clock(world, UTC + HOUR / 2)  # the time of the run before comes again, and is not driven
    world.run(0.1)
    assert world.task(following.id).terms.start_utc == UTC + 2 * HOUR
    set_clock(world, UTC - DAY)
    world.run(0.1)
    assert world.task(following.id).terms.start_utc == UTC - DAY + HOUR
    check_each_series_once(world)
