"""Records of decisions in an MCAP file: each change of a task with all that is known of it."""

import gzip
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("mcap", reason="the extra mcap is not installed")

from mav_tasks.engine.inputs import AtOnce, LinkChanged, LinkSide, Packets, WallClock
from mav_tasks.errors import RecordError, UsageError
from mav_tasks.recording import observers
from mav_tasks.settings import Recording, Settings
from mav_tasks.tasks import events as e
from mav_tasks.tasks.goal import Move
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Marks, Progress, Submitter, Task, TaskId, Terms
from tests.unit.mcap_export.test_round_trip import FIRST, json_of, made_of

SENDER = Submitter("clients", "127.0.0.1:5", 255, 190)
TERMS = Terms(priority=7, label="patrol")
TASK = Task(TaskId(3), 1, 54000, Move(2.0), SENDER, Marks(), 0.0, terms=TERMS)
HELD = replace(TASK, id=TaskId(2), state=TaskState.HELD, reason=TaskReason.RESTARTED)
OVER = replace(HELD, id=TaskId(1), state=TaskState.COMPLETED)
STARTS = e.TaskChanged(
    *(TaskId(3), 2, 4, TaskState.QUEUED, TaskState.STARTING, TaskReason.NONE, "server", 1.0),
    Progress(),
)
EVENTS: list[e.Event] = [
    e.TaskSubmitted(TASK, 0.0),
    e.TaskModified(TaskId(3), 1, 2, replace(TERMS, label="home"), "255/190", 1.0, TERMS),
    e.TaskAssigned(TaskId(3), 2, 3, 1, "rover 1: silent; free", 1.0),
    STARTS,
    e.TaskProgressed(TaskId(3), 2, 4, Progress(), 1.0),
    e.TaskWithdrawn(TaskId(3), 2, 1.0),
    replace(STARTS, task_id=TaskId(9), new=TaskState.CANCELLED),
]
LINK = LinkChanged("rovers", LinkSide.VEHICLES, up=True)
ONE = Packets("rovers", [("rover", FIRST[8:])])


def made(folder: Path, *, with_clock: bool = True) -> Path:
    recording = Recording(decisions=str(folder))
    (record,) = observers(recording, Settings(), Restored((OVER, HELD)), now=0.0)
    for item in (LINK, *([WallClock(1.7e9)] if with_clock else []), None, ONE, AtOnce((ONE, ONE))):
        record.on_input(item, now=1.0)
    record.on_output([], EVENTS, now=2.0)
    record.close()
    (path,) = folder.iterdir()
    return path


def test_tasks_and_packets_of_a_record_are_told(tmp_path: Path) -> None:
    out, counts = made_of(tmp_path, made(tmp_path / "made"))
    found = json_of(out)
    told = (
        "{event} {task} {rover} {state} {label} {version}".format_map(each)
        for each in found["/tasks/changes"]
    )
    assert list(told) == [
        "restored 2 1 held patrol 1",
        "submitted 3 1 queued patrol 1",
        "modified 3 1 queued home 2",
        "assigned 3 2 queued home 3",
        "changed 3 2 starting home 4",
        "withdrawn 3 2 starting home 4",
        "changed 9 2 cancelled  4",
    ]
    assert len(found["/tasks/log"]) == len(EVENTS) - 1, "progress is in TASK_STATUS"
    assert (counts.packets, len(found["/mavlink/1/1/ATTITUDE"])) == (3, 3)
    log = tmp_path / "a.tlog"
    log.write_bytes(FIRST)
    _, counts = made_of(tmp_path, log, made(tmp_path / "clock", with_clock=False))
    assert (counts.packets, counts.events) == (1, len(EVENTS)), "its packets are in the log"


def test_what_cannot_be_exported_is_named(tmp_path: Path) -> None:
    path = made(tmp_path / "made")
    with pytest.raises(UsageError, match="two recordings are named"):
        made_of(tmp_path, path, path)
    for name, words in (("none", "No such file"), ("made", "not a file")):
        with pytest.raises(RecordError, match=words):
            made_of(tmp_path, tmp_path / name)
    *lines, _ = gzip.decompress(path.read_bytes()).splitlines(keepends=True)
    packed = gzip.compress(b"".join(lines))
    odd = gzip.compress(b"".join(lines).replace(b'["TaskWithdrawn"', b'["TaskLost"'))
    for data, words in ((packed + b"more", "data after its end"), (odd, "KeyError: 'TaskLost'")):
        path.write_bytes(data)
        with pytest.raises(RecordError, match=words):
            made_of(tmp_path, path)
