"""Queues and finished tasks as tables of any width and height, and tasks in words."""

import io
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from math import inf, pi
from pathlib import Path

import pytest
from rich.cells import cell_len
from rich.console import Console

from mav_tasks.cli import words
from mav_tasks.cli.tables import history_table, queue_table, vehicle_table
from mav_tasks.client.descriptions import waits_of, why_of
from mav_tasks.client.json_form import history_json, queue_json, task_json, vehicle_json
from mav_tasks.client.values import QueueStatus, TaskStatus, Unit, VehicleStatus
from mav_tasks.tasks.lifecycle import TaskReason, TaskState

RUNNING = TaskStatus(
    id=12,
    vehicle=1,
    state=TaskState.EXECUTING,
    reason=TaskReason.NONE,
    words="rotate 90 deg: executing",
    priority=8,
    after=0,
    nonce=5,
    command=54001,
    progress=0.45,
    remaining=pi / 4,
    unit=Unit.RADIANS,
    position=None,
    time_to_start=0.0,
    time_to_finish=2.0,
    execution_time=1.5,
    item=1,
    items=1,
    submitter="244/190",
    version=3,
)
HELD = replace(RUNNING, state=TaskState.HELD, reason=TaskReason.OFF_TRACK)
WAITING = replace(
    RUNNING,
    id=13,
    state=TaskState.QUEUED,
    reason=TaskReason.BEHIND_OTHERS,
    words="move 2 m: queued (behind other tasks)",
    progress=0.0,
    remaining=1.2000000476837158,
    unit=Unit.METRES,
    position=0,
    time_to_start=75.0,
    time_to_finish=82.0,
    after=12,
)
QUEUE = QueueStatus(
    vehicle=1,
    running=12,
    next=13,
    capacity=1000,
    counts={TaskState.QUEUED: 1, TaskState.EXECUTING: 1},
    paused=None,
    waiting=(WAITING,),
    current=RUNNING,
    version=9,
)
LONG = replace(
    QUEUE,
    counts={TaskState.QUEUED: 300, TaskState.EXECUTING: 1},
    waiting=tuple(replace(WAITING, id=number) for number in range(13, 113)),
)


def drawn(queue: QueueStatus, *, width: int, rows: int | None = None) -> list[str]:
    console = Console(file=io.StringIO(), width=width, color_system=None, legacy_windows=False)
    with console.capture() as captured:
        console.print(queue_table(queue, width=width, rows=rows))
    return [line.rstrip() for line in captured.get().splitlines()]


def test_a_terminal_of_80_columns_shows_why_each_task_waits_and_when_it_runs() -> None:
    lines = [
        "rover 1: task 12 executing; 1 waiting",
        "1 queued, 1 executing",
        "id  prio  state      goal           reason           starts in     ends in  done",
        "12     8  executing  rotate 90 deg                                     2 s  45 %",
        "13     8  queued     move 2 m       behind task 12  1 min 15 s  1 min 22 s   0 %",
    ]
    assert drawn(QUEUE, width=80) == lines
    wider = drawn(QUEUE, width=120)
    assert [line.split()[0] for line in wider[2:]] == ["id", "12", "13"]
    for name in ("left", "by"):
        assert name in wider[2].split()


def test_a_narrow_window_shows_what_matters_most() -> None:
    assert drawn(QUEUE, width=44) == [
        "rover 1: task 12 executing; 1 waiting",
        "1 queued, 1 executing",
        "id  state      goal           reason",
        "12  executing  rotate 90 deg",
        "13  queued     move 2 m       behind task 12",
    ]


@pytest.mark.parametrize("width", [40, 60, 80])
def test_no_id_is_cut_off(width: int) -> None:
    ids = [1_053_687_421, 1_053_687_422]
    tasks = [replace(WAITING, id=number, state=TaskState.SCHEDULED) for number in ids]
    lines = drawn(replace(QUEUE, waiting=tuple(tasks)), width=width)
    assert max(map(cell_len, lines)) <= width
    assert [line.split()[0] for line in lines[4:]] == [str(number) for number in ids]


WAITS = {
    13: (TaskState.QUEUED, TaskReason.BEHIND_OTHERS, 0, "behind task 12"),
    14: (TaskState.QUEUED, TaskReason.BEHIND_OTHERS, 0, "behind task 13"),
    15: (TaskState.BLOCKED, TaskReason.DEPENDENCY, 13, "after task 13"),
    16: (TaskState.SCHEDULED, TaskReason.START_TIME, 0, "start time"),
    17: (TaskState.SCHEDULED, TaskReason.START_TIME, 14, "start time, after task 14"),
    18: (TaskState.BLOCKED, TaskReason.WAITING_FOR_START, 0, "needs a start command"),
    19: (TaskState.QUEUED, TaskReason.DISARMED, 0, "disarmed"),
}


def test_each_waiting_task_says_why_it_waits() -> None:
    tasks = [
        replace(WAITING, id=number, state=state, reason=reason, after=after, words="wait 1 s: x")
        for number, (state, reason, after, _) in WAITS.items()
    ]
    queue = replace(QUEUE, waiting=tuple(tasks))
    assert waits_of(queue) == {number: each[3] for number, each in WAITS.items()}
    shown = queue_json(queue)["waiting"]
    assert [each["why"] for each in shown] == [each[3] for each in WAITS.values()]


def test_a_time_that_nobody_knows_is_unknown() -> None:
    paused = replace(WAITING, time_to_start=None, time_to_finish=None)
    line = drawn(replace(QUEUE, waiting=(paused,)), width=100)[-1]
    assert " task 12    unknown  unknown " in line


def test_what_was_saved_before_a_crash_is_a_bound() -> None:
    held = replace(HELD, reason=TaskReason.OUTCOME_UNKNOWN, progress=0.57)
    assert words.percent_of(held) == "at least 57 %"
    assert words.left_of(held) == "at most 45.0 deg"
    assert words.percent_of(HELD) == "45 %"


NOW = datetime(2026, 11, 24, 14, 3, 12, tzinfo=timezone(timedelta(hours=1), "CET"))
DONE = replace(
    RUNNING,
    state=TaskState.COMPLETED,
    words="rotate 90 deg: completed",
    progress=1.0,
    time_to_finish=None,
    execution_time=12.34,
    ended_ago=72.0,
)
CANCELLED = replace(
    DONE,
    id=9,
    state=TaskState.CANCELLED,
    reason=TaskReason.CANCELLED,
    words="move 2 m: cancelled (cancelled)",
    progress=0.0,
    execution_time=None,
    ended_ago=86_400.0,
)
STUCK = replace(DONE, id=8, state=TaskState.FAILED, reason=TaskReason.STUCK, ended_ago=None)


def test_finished_tasks_say_how_and_when_they_ended() -> None:
    console = Console(file=io.StringIO(), width=80, color_system=None)
    with console.capture() as captured:
        console.print(history_table([DONE, CANCELLED, STUCK], now=NOW, width=80))
    assert [line.rstrip() for line in captured.get().splitlines()] == [
        "id  state      goal           reason       ended (CET)  run time   done",
        "12  completed  rotate 90 deg                  14:02:00     12.3s  100 %",
        " 9  cancelled  move 2 m               2026-11-23 14:03              0 %",
        " 8  failed     rotate 90 deg  stuck                        12.3s  100 %",
    ]


def test_a_finished_task_as_json_has_the_moment_of_its_end() -> None:
    done = history_json(DONE, now=NOW)
    assert (done["ended_ago"], done["ended_at"]) == (72.0, "2026-11-24T14:02:00+01:00")
    assert (done["state"], done["why"]) == ("completed", None)
    assert history_json(STUCK, now=NOW)["ended_at"] is None


@pytest.mark.parametrize("width", [20, 27, 40, 57, 80, 133])
@pytest.mark.parametrize("rows", [3, 4, 10, 24, 200])
def test_it_fits_any_window(width: int, rows: int) -> None:
    for queue in (QUEUE, LONG, replace(LONG, paused=TaskReason.OPERATOR)):
        lines = drawn(queue, width=width, rows=rows)
        assert max(cell_len(line) for line in lines) <= width
        assert len(lines) <= rows


def test_what_has_no_room_is_counted() -> None:
    lines = drawn(LONG, width=80, rows=10)
    assert len(lines) == 10
    assert lines[-1] == "and 295 more"  # of 301, behind two lines, the names, and six tasks
    assert drawn(LONG, width=80)[-1] == "and 200 more"  # that were not asked for


@pytest.mark.parametrize(
    ("queue", "line"),
    [
        (replace(QUEUE, current=None, running=None), "rover 1: no task runs; 1 waiting"),
        (
            replace(QUEUE, current=None, running=None, paused=TaskReason.STOPPED),
            (
                "rover 1: no task runs; queue paused (STOP);"
                " to let it run, use: mav-tasks resume; 1 waiting"
            ),
        ),
        (
            replace(QUEUE, current=HELD),
            (
                "rover 1: task 12 held (off track); "
                "release it: mav-tasks release 12 again|remainder|skip; 1 waiting"
            ),
        ),
    ],
)
def test_the_first_line_says_what_is_in_the_way_and_what_to_do(
    queue: QueueStatus, line: str
) -> None:
    assert drawn(queue, width=120)[0] == line


def test_a_task_in_one_line_says_what_it_is_and_why_it_ended() -> None:
    assert words.line_of(WAITING) == "rover 1: task 13: move 2 m: queued (behind other tasks)"
    stuck = replace(RUNNING, state=TaskState.FAILED, reason=TaskReason.STUCK, execution_time=12.34)
    assert words.line_of(stuck) == "rover 1: task 12: rotate 90 deg: failed (stuck), in 12.3s"


def test_why_it_waits_has_the_rovers_own_words() -> None:
    starting = replace(RUNNING, state=TaskState.STARTING, reason=TaskReason.NOT_READY)
    said = replace(starting, words="move 2 m: starting (not ready: PreArm: no fix)")
    cut = replace(starting, words="move 2 m: starting (not ready: PreArm: GPS 1: Bad")
    silent = replace(starting, words="move 2 m: starting (not ready)")
    assert why_of(said) == "not ready: PreArm: no fix"
    assert why_of(cut) == "not ready: PreArm: GPS 1: Bad"
    assert why_of(silent) == "not ready"


def test_a_released_task_that_waits_for_its_rover_needs_no_decision() -> None:
    assert "release it: mav-tasks release 12" in words.line_of(HELD)
    released = replace(HELD, reason=TaskReason.NO_POSITION)
    assert words.way_on_of(released) == "wait until the rover knows its position; check its GPS"


RESUME = "to let it run, use: mav-tasks resume"
ARM = "arm the rover in HOLD; or, if the server may arm it, use: mav-tasks resume"


@pytest.mark.parametrize(
    ("task", "line"),
    [
        (
            replace(WAITING, reason=TaskReason.RESTARTED),
            "rover 1: task 13: move 2 m: queued (after a restart); " + RESUME,
        ),
        (
            replace(WAITING, reason=TaskReason.QUEUE_PAUSED),
            "rover 1: task 13: move 2 m: queued (queue paused); " + RESUME,
        ),
        (
            replace(RUNNING, state=TaskState.PAUSED, reason=TaskReason.TAKEOVER),
            (
                "rover 1: task 12: rotate 90 deg: paused (takeover); once nobody else drives it,"
                " centre the sticks, set HOLD, then use: mav-tasks resume"
            ),
        ),
        (
            replace(RUNNING, state=TaskState.PAUSED, reason=TaskReason.PREEMPTED),
            "rover 1: task 12: rotate 90 deg: paused (preempted)",
        ),
        (
            HELD,
            (
                "rover 1: task 12: rotate 90 deg: held (off track); "
                "release it: mav-tasks release 12 again|remainder|skip"
            ),
        ),
    ],
)
def test_a_task_that_waits_for_the_operator_says_what_to_do(task: TaskStatus, line: str) -> None:
    assert words.line_of(task) == line


def test_what_to_do_is_not_cut_off_where_lines_can_go_on() -> None:
    paused = replace(QUEUE, paused=TaskReason.OPERATOR)
    assert "mav-tasks resume" in " ".join(drawn(paused, width=46))


def test_no_number_is_minus_nothing() -> None:
    rover = VehicleStatus(1, "ardupilot", False, "HOLD", True, 191, north=-0.001)
    console = Console(file=io.StringIO(), width=120)
    with console.capture() as captured:
        console.print(vehicle_table([rover], width=120))
    assert " 0.00 m" in captured.get()
    assert "-0.00" not in captured.get()


def test_json_has_degrees_names_and_nulls() -> None:
    task = task_json(RUNNING)
    assert (task["state"], task["reason"], task["what"]) == ("executing", None, "rotate 90 deg")
    assert (task["left"], task["left_unit"], task["progress"]) == (45.0, "deg", 0.45)
    assert (task["after"], task["position"]) == (None, None)
    waiting = task_json(WAITING)
    assert (waiting["reason"], waiting["left"], waiting["after"]) == ("behind_others", 1.2, 12)
    assert queue_json(QUEUE)["current"] == task
    assert queue_json(QUEUE)["waiting"] == [waiting | {"why": "behind task 12"}]
    assert queue_json(replace(QUEUE, paused=TaskReason.TAKEOVER))["paused"] == "takeover"


def test_what_is_not_known_of_a_rover_is_a_dash() -> None:
    rover = VehicleStatus(3, "px4", True, "OFFBOARD", True, 191, north=1.5, east=-2.25, yaw=-pi / 2)
    console = Console(file=io.StringIO(), width=120, color_system=None)
    with console.capture() as captured:
        console.print(vehicle_table([rover], width=120))
    cells = captured.get().splitlines()[1].split("  ")
    assert [cell.strip() for cell in cells if cell] == [
        *("3", "px4", "OFFBOARD", "armed", "yes", "1.50 m", "-2.25 m", "270.0 deg", "-"),
    ]
    assert vehicle_json(rover)["heading"] == 270.0


@pytest.mark.parametrize(
    ("age", "said"),
    [
        (None, ""),
        (0.9, ""),
        (12.0, "silent for 12s"),
        (inf, "not heard since the server started"),
    ],
)
def test_a_queue_says_how_old_its_news_is(age: float | None, said: str) -> None:
    headline = words.headline_of(replace(QUEUE, heartbeat_age=age))
    assert headline.startswith(f"rover 1 ({said}): " if said else "rover 1: ")


def test_json_has_no_infinity() -> None:
    assert queue_json(replace(QUEUE, heartbeat_age=inf))["heartbeat_age"] is None
    assert queue_json(replace(QUEUE, heartbeat_age=1.25))["heartbeat_age"] == 1.25


PAUSED = replace(QUEUE, paused=TaskReason.OPERATOR, current=None, running=None)
NEW = replace(WAITING, reason=TaskReason.QUEUE_PAUSED, words="move 2 m: queued (queue paused)")


@pytest.mark.parametrize(
    ("status", "queue", "said"),
    [
        (WAITING, QUEUE, ""),
        (RUNNING, QUEUE, ""),
        (NEW, PAUSED, "the queue is paused (operator); to let it run, use: mav-tasks resume"),
        (
            replace(NEW, reason=TaskReason.HELD_AHEAD),
            replace(QUEUE, current=HELD),
            "task 12 is held (off track); release it: mav-tasks release 12 again|remainder|skip",
        ),
        (
            replace(NEW, reason=TaskReason.DISARMED, words="move 2 m: queued (disarmed)"),
            replace(QUEUE, current=None),
            f"disarmed; {ARM}",
        ),
    ],
)
def test_a_new_task_that_does_not_run_says_why(
    status: TaskStatus, queue: QueueStatus, said: str
) -> None:
    expected = f"rover 1: task 13 waits: {said}" if said else ""
    assert words.why_it_waits(status, queue) == expected


DISARMED = replace(WAITING, reason=TaskReason.DISARMED, words="move 2 m: queued (disarmed)")


@pytest.mark.parametrize(
    ("reason", "said"),
    [
        (TaskReason.QUEUE_PAUSED, "to let it run, use: mav-tasks resume --vehicle 1"),
        (
            TaskReason.DISARMED,
            f"{ARM} --vehicle 1",
        ),
        (TaskReason.WRONG_MODE, "set the rover to HOLD, then use: mav-tasks resume --vehicle 1"),
        (TaskReason.NOT_READY, "wait, or mend what the rover reports"),
        (
            TaskReason.LOSS_FAILSAFE,
            (
                "let the rover stop when setpoints end:"
                " run 'mav-tasks probe --set-failsafe --vehicle 1'"
            ),
        ),
        (TaskReason.OUTSIDE_OWN_FENCE, "drive the rover back manually, or switch that fence off"),
        (TaskReason.BEHIND_OTHERS, ""),
        (
            TaskReason.HELD_AHEAD,
            (
                "look at the queue, and release the held task before it:"
                " mav-tasks release again|remainder|skip --vehicle 1"
            ),
        ),
        (TaskReason.OTHER_CONTROLLER, "end the other program that drives the rover"),
    ],
)
def test_one_of_several_rovers_is_named_in_the_command(reason: TaskReason, said: str) -> None:
    status = replace(WAITING, reason=reason)
    assert words.way_on_of(status, is_alone=False) == said
    assert words.way_on_of(status) == said.replace(" --vehicle 1", "")
    assert words.line_of(status, is_alone=False).endswith(f"; {said}" if said else ")")


def test_a_task_that_has_ended_needs_no_command() -> None:
    for state in (TaskState.FAILED, TaskState.CANCELLED):
        assert words.way_on_of(replace(STUCK, state=state, reason=TaskReason.TAKEOVER)) == ""


def test_a_paused_queue_of_one_of_several_rovers_names_it() -> None:
    resume = "to let it run, use: mav-tasks resume --vehicle 1"
    assert words.headline_of(PAUSED, is_alone=False) == (
        f"rover 1: no task runs; queue paused (operator); {resume}; 1 waiting"
    )
    why = words.why_it_waits(NEW, PAUSED, is_alone=False)
    assert why.endswith(f"waits: the queue is paused (operator); {resume}")
    text = " ".join(str(each) for each in drawn_of_several(PAUSED))
    assert resume in text


def drawn_of_several(queue: QueueStatus) -> list[str]:
    console = Console(file=io.StringIO(), width=200, color_system=None)
    with console.capture() as captured:
        console.print(queue_table(queue, width=200, is_alone=False))
    return captured.get().splitlines()


def test_the_first_line_says_what_the_next_task_waits_for_and_what_to_do() -> None:
    idle = replace(QUEUE, current=None, running=None, waiting=(DISARMED,))
    assert words.headline_of(idle) == (
        f"rover 1: no task runs; task 13 waits: disarmed; {ARM}; 1 waiting"
    )
    starting = replace(RUNNING, state=TaskState.STARTING, reason=TaskReason.NOT_READY)
    assert words.headline_of(replace(QUEUE, current=starting)) == (
        "rover 1: task 12 starting (not ready); wait, or mend what the rover reports; 1 waiting"
    )
    paused = replace(idle, paused=TaskReason.OPERATOR)
    assert "disarmed" not in words.headline_of(paused)


@pytest.mark.parametrize("width", [40, 60, 80, 120])
def test_rovers_fit_a_narrow_terminal_with_no_cell_cut(width: int) -> None:
    rover = VehicleStatus(
        *(112, "ardupilot", True, "GUIDED", False, 191, -1234.56, 1234.56, 3.0, 1.25),
        heartbeat_age=754.0,
    )
    console = Console(file=io.StringIO(), width=width, color_system=None)
    with console.capture() as captured:
        console.print(vehicle_table([rover, rover], width=width))
    lines = captured.get().splitlines()
    assert len(lines) == 3
    assert max(map(cell_len, lines)) <= width
    assert "…" not in captured.get()
    for shown in ("112", "armed", "GUIDED", "12m34s ago"):
        assert shown in lines[1]
    assert ("ardupilot" in lines[1]) is (width >= 80)


@pytest.mark.parametrize(("yaw", "shown"), [(-0.0004, "0.0 deg"), (2 * pi - 0.0004, "0.0 deg")])
def test_no_heading_is_360(yaw: float, shown: str) -> None:
    rover = VehicleStatus(1, "px4", True, "HOLD", True, 191, yaw=yaw)
    console = Console(file=io.StringIO(), width=120, color_system=None)
    with console.capture() as captured:
        console.print(vehicle_table([rover], width=120))
    assert f" {shown}" in captured.get()
    assert vehicle_json(replace(rover, yaw=-1e-9))["heading"] == 0.0


def test_the_guide_names_each_field_of_json() -> None:
    guide = (Path(__file__).parents[3] / "mav_tasks/GUIDE.md").read_text(encoding="utf-8")
    part = guide[guide.index("### The fields of --json") : guide.index("### Any rover")]
    queue = queue_json(QUEUE)
    for name in (*task_json(WAITING), *history_json(DONE, now=NOW), *queue):
        assert f"`{name}`" in part, name
