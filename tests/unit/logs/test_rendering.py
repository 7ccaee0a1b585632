"""Every kind of event becomes words, a JSON object and a row of a table, each readable again."""

import csv
import io
import json
import logging
import time
from dataclasses import replace
from math import inf, nan

import pytest

from mav_tasks.errors import UsageError
from mav_tasks.logs.export import COLUMNS, csv_entry, json_entry, parse_moment, text_entries
from mav_tasks.logs.lines import json_line
from mav_tasks.logs.rendering import clean, in_commands, level_of, utc_text
from mav_tasks.tasks.events import (
    Event,
    PlanStored,
    QueueContinued,
    QueuePaused,
    ServerStopped,
    StepReached,
    SubmissionRefused,
    TaskAdvanced,
    TaskAssigned,
    TaskChanged,
    TaskModified,
    TaskProgressed,
    TaskSubmitted,
    TaskWaits,
    TaskWithdrawn,
    VehicleArmingSet,
    VehicleHalted,
    VehicleHomeSet,
    VehicleIdentified,
    VehicleNoted,
    VehicleSeen,
    VehicleSpeedSet,
)
from mav_tasks.tasks.goal import Drive, GlobalPlace, Goal, GoTo, Move, Plan, Wait
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.server_events import ParameterSet, SignatureRefused, SignaturesSeen
from mav_tasks.tasks.task import Frame, Marks, Pose, Progress, Task, TaskId, Terms
from mav_tasks.tasks.timing import Timing
from tests.unit.tasks.samples import SOMEBODY, TASK_MOVE

NEEDS_A_HAND = TaskState.FAILED, TaskState.HELD, TaskState.EXPIRED
UTC = 1_795_255_200.25
TIME = "2026-11-21T10:00:00.250Z"
AT = 100.25
OFFSET = UTC - AT
ID = TaskId(17)
PROGRESS = Progress(Pose(1.0, 2.0, nan), frame=Frame(470_000_000, None, AT - 50))


def task(goal: Goal) -> Task:
    return Task(ID, 1, TASK_MOVE, goal, SOMEBODY, Marks(1, "a", "b"), AT, Terms(deadline=AT + 60))


CHANGED = TaskChanged(
    ID, 1, 3, TaskState.EXECUTING, TaskState.PAUSED, TaskReason.LINK_LOST, "server", AT, PROGRESS
)
TIMING = Timing(0.05, 136, 0.05, 0.0512, 0.15, 1, (500, 135, 1500, 1))
DRIVEN = replace(CHANGED, timing=TIMING)
FIGURES = {"count": 136, "p50": 0.05, "p99": 0.0512, "longest": 0.15, "late": 1}
REFUSED = SubmissionRefused(1, 54000, TaskReason.QUEUE_FULL, "it is full", "255/190@a", AT)

#: an event of each kind, and what its object says besides event, time, level, message and vehicle
SAMPLES: list[tuple[Event, dict[str, object]]] = [
    (TaskSubmitted(task(Move(3.0)), AT), {"task": 17, "actor": str(SOMEBODY), "state": "queued"}),
    (CHANGED, {"task": 17, "old": "executing", "new": "paused", "reason": "link_lost"}),
    (DRIVEN, {"timing": {**FIGURES, "period": 0.05}}),
    (TaskAdvanced(ID, 1, 4, PROGRESS, AT), {"task": 17, "version": 4}),
    (TaskProgressed(ID, 1, 4, PROGRESS, AT), {"task": 17, "version": 4}),
    (StepReached(ID, 1, 2, True, AT, 3), {"task": 17, "step": 2, "performs": True, "item": 3}),
    (PlanStored(1, 0, 5, "source", "a", AT), {"kind": 0, "plan_id": 5, "actor": "a"}),
    (TaskModified(ID, 1, 2, Terms(priority=9), "a", AT), {"task": 17, "actor": "a", "version": 2}),
    (
        TaskAssigned(ID, 2, 3, 1, "rover 1: silent; free", AT),
        {"task": 17, "before": 1, "choice": "rover 1: silent; free", "version": 3},
    ),
    (TaskWaits(ID, 1, TaskReason.DISARMED, AT), {"task": 17, "reason": "disarmed"}),
    (TaskWithdrawn(ID, 1, AT), {"task": 17}),
    (REFUSED, {"command": 54000, "reason": "queue_full", "text": "it is full"}),
    (QueuePaused(1, TaskReason.STOPPED, "a", AT), {"reason": "stopped", "actor": "a"}),
    (QueueContinued(1, "a", AT), {"actor": "a"}),
    (VehicleIdentified(1, "uid", AT), {"uid": "uid"}),
    (VehicleArmingSet(1, False, AT), {"may_arm": False}),
    (VehicleSpeedSet(1, 0.5, "a", AT), {"speed": 0.5, "actor": "a"}),
    (
        VehicleHomeSet(1, 473_977_418, 85_455_938, Frame(None, None, AT - 50), "a", AT),
        {"latitude_degE7": 473_977_418, "longitude_degE7": 85_455_938, "actor": "a"},
    ),
    (ParameterSet("SPEED", nan, "a", AT), {"name": "SPEED", "value": None, "actor": "a"}),
    (SignaturesSeen((), (), 7, AT), {"signed_until": 7}),
    (
        VehicleHalted(1, 7, TaskReason.OPERATOR, "a", AT),
        {"epoch": 7, "reason": "operator", "actor": "a"},
    ),
    (SignatureRefused("a signed anna", 90.0, AT), {"actor": "a signed anna", "seconds": 90.0}),
    (VehicleSeen(1, "found", AT), {"text": "found"}),
    (VehicleNoted(1, "silent", AT), {"text": "silent"}),
    (ServerStopped((1, 2), AT), {"unconfirmed": [1, 2]}),
]
KINDS = pytest.mark.parametrize(
    ("event", "values"), SAMPLES, ids=[type(event).__name__ for event, _ in SAMPLES]
)


def test_there_is_a_sample_of_every_kind() -> None:
    assert {type(event) for event, _ in SAMPLES} == set(Event.__args__)


def strictly(line: str) -> dict[str, object]:
    """Read one JSON object as a strict reader does, to which NaN is none."""

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    value = json.loads(line, parse_constant=refuse)
    assert isinstance(value, dict)
    assert "\n" not in line.rstrip("\n")
    return value


@KINDS
def test_the_export_and_the_log_have_the_same_fields(
    event: Event, values: dict[str, object]
) -> None:
    in_utc = json_entry(9, shifted(event))
    exported = strictly(in_utc)
    assert exported.pop("number") == 9
    assert exported.items() >= values.items()
    assert (exported["event"], exported["time"]) == (type(event).__name__, TIME)
    assert exported["message"] == str(event)
    of_none = ParameterSet | ServerStopped | SignaturesSeen | SignatureRefused
    assert "vehicle" in exported or isinstance(event, of_none)
    record = logging.makeLogRecord({"msg": event, "levelno": 20, "levelname": "INFO"})
    record.created = UTC
    logged = strictly(json_line(record, str(event), None))
    assert set(logged) == set(exported)
    assert {**logged, "level": "", "progress": 0, "terms": 0, "frame": 0} == {
        **exported,
        "level": "",
        "progress": 0,
        "terms": 0,
        "frame": 0,
    }


def shifted(event: Event) -> Event:
    """The event as the journal gives it, its own time in UTC."""
    return replace(event, at=UTC)


@KINDS
def test_the_table_has_a_row_of_each(event: Event, values: dict[str, object]) -> None:
    (row,) = csv.reader(io.StringIO(csv_entry(9, shifted(event))))
    cells = dict(zip(COLUMNS, row, strict=True))
    assert (cells["number"], cells["time"], cells["words"]) == ("9", TIME, str(event))
    for name in ("task", "old", "new", "reason", "actor"):
        if name in values:
            assert cells[name] == str(values[name])


def test_the_figures_of_a_drive_are_in_its_line_and_in_cells_of_their_own() -> None:
    words = (
        "rover 1: task 17 paused: rover silent; "
        "136 setpoints at 20 Hz: p50 50.0, p99 51.2, max 150.0 ms, "
    )
    assert str(DRIVEN) == f"{words}1 late"
    assert list(text_entries([(9, shifted(DRIVEN))])) == [f"{TIME} {words}1 late\n"]
    (row,) = csv.reader(io.StringIO(csv_entry(9, shifted(DRIVEN))))
    cells = dict(zip(COLUMNS, row, strict=True))
    assert {name: float(cells[name]) for name in FIGURES} == FIGURES
    (row,) = csv.reader(io.StringIO(csv_entry(9, shifted(CHANGED))))
    assert row[-6:] == [""] * 6


def test_a_submission_says_what_it_is_about() -> None:
    way = GoTo(GlobalPlace(470_000_000, 80_000_000), speed=inf)
    goals: list[tuple[Goal, object]] = [
        (Drive(0.5, nan, 2.0), {"forward": 0.5, "yaw_rate": None, "duration": 2.0}),
        (
            Plan((Wait(1.0), way), "source"),
            {"steps": 2, "first": 0, "has_home": False, "has_options": False},
        ),
    ]
    for goal, said in goals:
        value = strictly(json_entry(1, TaskSubmitted(task(goal), UTC)))["goal"]
        assert value == {"kind": type(goal).__name__} | said  # type: ignore[operator]
    place = strictly(json_entry(1, TaskSubmitted(task(way), UTC)))["goal"]["place"]  # type: ignore[index]
    assert place["kind"] == "GlobalPlace"


def test_a_submission_is_named_by_its_label() -> None:
    one = task(Move(3.0))
    words = "rover 1: task 17 submitted: move 3 m{}, priority 5, by " + str(SOMEBODY)
    assert str(TaskSubmitted(one, AT)) == words.format("")
    labelled = replace(one, terms=replace(one.terms, label="patrol"))
    assert str(TaskSubmitted(labelled, AT)) == words.format(" 'patrol'")


@pytest.mark.parametrize(
    ("new", "reason", "actor", "words"),
    [
        (TaskState.CANCELLED, TaskReason.CANCELLED, "255/190@a", "cancelled by 255/190@a"),
        (TaskState.CANCELLED, TaskReason.CLEARED, "255/190@a", "cancelled: cleared, by 255/190@a"),
        (TaskState.PAUSED, TaskReason.OPERATOR, "255/190@a", "paused by 255/190@a"),
        (TaskState.PAUSED, TaskReason.TAKEOVER, "vehicle 1", "paused: takeover, by vehicle 1"),
        (TaskState.STARTING, TaskReason.NONE, "255/190@a", "starting, by 255/190@a"),
        (TaskState.COMPLETED, TaskReason.NONE, "server", "completed"),
    ],
)
def test_a_change_says_why_and_who_and_nothing_twice(
    new: TaskState, reason: TaskReason, actor: str, words: str
) -> None:
    event = replace(CHANGED, new=new, reason=reason, actor=actor)
    assert str(event) == f"rover 1: task 17 {words}"


def test_times_within_an_event_are_utc() -> None:
    record = logging.makeLogRecord({"msg": TaskSubmitted(task(Move(1.0)), AT), "levelname": "INFO"})
    record.created = time.monotonic() + OFFSET
    terms = strictly(json_line(record, "", None))["terms"]
    assert str(terms["deadline"])[:18] == "2026-11-21T10:01:0"  # type: ignore[index]
    assert (utc_text(nan), utc_text(inf), utc_text(1e18)) == (None, None, None)
    assert utc_text(1_800_014_900.2) == "2027-01-15T12:08:20.200Z"
    assert utc_text(1_800_014_900.9999999) == "2027-01-15T12:08:21.000Z"


def test_what_came_from_the_wire_gives_no_orders_to_a_terminal() -> None:
    event = VehicleNoted(1, "a\x1b[31mb\r\nc\x07\u202ed\x9b é", UTC)
    assert clean(str(event)) == "rover 1: a[31mb  cd é"
    assert list(text_entries([(1, event)])) == [f"{TIME} rover 1: a[31mb  cd é\n"]
    assert strictly(json_entry(1, event))["text"] == event.text
    assert "\x1b" not in csv_entry(1, event)


@pytest.mark.parametrize(
    ("text", "utc"),
    [
        ("2h", 10_000 - 7_200),
        ("1.5m", 10_000 - 90),
        ("1d", 10_000 - 86_400),
        ("1970-01-01T01:00", 3_600),
        ("1970-01-01T02:00+01:00", 3_600),
        ("1970-01-02", 86_400),
    ],
)
def test_since_when(text: str, utc: float) -> None:
    assert parse_moment("--since", text, now=10_000.0) == utc


@pytest.mark.parametrize("text", ["", "2", "2x", "-2h", "yesterday", "2026-13-01"])
def test_since_when_is_not_understood(text: str) -> None:
    with pytest.raises(UsageError, match="--since"):
        parse_moment("--since", text, now=0.0)


@pytest.mark.parametrize(
    ("event", "level"),
    [
        *((replace(CHANGED, new=each), logging.WARNING) for each in NEEDS_A_HAND),
        (replace(CHANGED, new=TaskState.COMPLETED, reason=TaskReason.NONE), logging.INFO),
        (replace(CHANGED, new=TaskState.CANCELLED), logging.INFO),
        (QueuePaused(1, TaskReason.OPERATOR, "anna", AT), logging.INFO),
        (QueuePaused(1, TaskReason.STOPPED, "anna", AT), logging.WARNING),
        (QueuePaused(1, TaskReason.RESTARTED, "server", AT), logging.WARNING),
        (VehicleNoted(1, "silent", AT), logging.WARNING),
        (VehicleSeen(1, "heard again", AT), logging.INFO),
        (REFUSED, logging.WARNING),
    ],
)
def test_what_needs_a_hand_is_a_warning(event: Event, level: int) -> None:
    assert level_of(event) == level


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("STOP in force: press Continue first", "STOP in force: run 'mav-tasks resume' first"),
        (
            'task 3 is held. Press "Held: remainder", "Held: again" or "Held: skip", then Continue',
            "task 3 is held. run 'mav-tasks release again|remainder|skip', then 'mav-tasks resume'",
        ),
        ("task 3 moved on", "task 3 moved on"),
    ],
)
def test_people_at_a_command_line_read_commands_not_buttons(text: str, shown: str) -> None:
    assert in_commands(text) == shown
