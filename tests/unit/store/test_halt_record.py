"""The record of halts: what it keeps when the database keeps nothing, and when it does not."""

import os
import shutil
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest

from mav_tasks.basics.errors import StoreError
from mav_tasks.engine.inputs import HaltNotStored
from mav_tasks.tasks.events import (
    Event,
    QueueContinued,
    QueuePaused,
    VehicleArmingSet,
    VehicleHalted,
)
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.restored import Restored
from tests.kit.databases import halts_of, locked
from tests.unit.store.crashed import ROOT, crash
from tests.unit.store.full_disk import NO_NAMESPACE
from tests.unit.store.samples import keep, loaded, next_outcomes, opened, submitted

IN_ITS_OWN_MOUNTS = ("unshare", "--user", "--map-root-user", "--mount")
STOP = QueuePaused(1, R.STOPPED, "255/190@127.0.0.1:14550", 100.0)
CONTINUE = QueueContinued(1, "client", 101.0)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "tasks.sqlite3"


@pytest.fixture
def record_path(path: Path) -> Path:
    return path.with_name(f"{path.name}.halts")


def life(place: str | Path, *events: Event) -> None:
    """Let a store take events and end."""
    with opened(place) as store:
        store.append(events)


def restored(place: str | Path) -> Restored:
    with opened(place) as store:
        return loaded(store)


def test_what_only_the_record_took_is_in_force_in_the_next_life(place: str) -> None:
    halted = VehicleHalted(1, 7, R.STOPPED, "client", 100.0)
    crash(place, submitted(1), STOP, halted, VehicleArmingSet(2, False, 100.0))
    with opened(place) as store:
        found = loaded(store)
        journal = list(store.journal())
    assert (found.paused, found.ended_well) == ({1: R.STOPPED}, False)
    assert (found.halt_epochs, found.disarmed) == ({1: 7}, frozenset({2}))
    assert {STOP, halted} <= {event for number, event in journal if number > 1}
    assert found.stopped == restored(place).stopped == {1: R.STOPPED}  # until it stores an event
    crash(place, QueuePaused(1, R.OPERATOR, "client", 101.0), CONTINUE)
    assert restored(place).paused == {}  # the newest word counts, whoever kept it
    life(place, STOP)
    again = restored(place)
    assert (again.paused, again.stopped) == ({1: R.STOPPED}, {})


def test_a_database_that_knows_more_than_the_record_is_believed(place: str, tmp_path: Path) -> None:
    life(place, STOP)
    record_path = halts_of(place, tmp_path)
    older = record_path.read_bytes()
    life(place, CONTINUE)
    record_path.write_bytes(older)
    assert restored(place).paused == {}


def test_an_older_database_put_back_forgets_no_stop_and_gives_no_id_twice(path: Path) -> None:
    life(path, submitted(1))
    older = path.read_bytes()
    life(path, *map(submitted, range(2, 8)), STOP)
    path.write_bytes(older)
    found = restored(path)
    assert ([task.id for task in found.tasks], found.next_id) == ([1], 8)
    assert (found.paused, found.ended_well) == ({1: R.STOPPED}, False)


def test_a_word_that_is_cut_short_leaves_the_one_before(path: Path, record_path: Path) -> None:
    life(path)
    old, new = "ä" * 30, "somebody else"
    crash(path, QueuePaused(9, R.STOPPED, old, 1.0), QueuePaused(9, R.OPERATOR, new, 2.0))
    content = record_path.read_bytes()
    cut = content.replace(new.encode(), b"\xa5" * len(new))
    record_path.write_bytes(cut)
    assert restored(path).paused == {9: R.STOPPED}
    path.unlink()
    record_path.write_bytes(cut.replace("ä".encode() * 19, b"\xa5" * 38))
    with pytest.raises(StoreError, match="damaged"):
        restored(path)


@pytest.mark.parametrize("content", [b"", b"something else\n" * 4000, bytes(98_368), bytes(65_600)])
def test_what_is_no_record_is_refused_in_one_line(
    path: Path, record_path: Path, content: bytes
) -> None:
    record_path.write_bytes(content)
    with pytest.raises(StoreError) as caught:
        opened(path).__enter__()
    assert str(caught.value).startswith(f"store {path}: {record_path.name}: it is damaged")
    assert record_path.read_bytes() == content
    record_path.unlink()
    assert restored(path).paused == {}  # nothing of the refused store holds on to its lock
    record_path.unlink()
    record_path.symlink_to("/etc/passwd")
    with pytest.raises(StoreError, match="symbolic link"):
        opened(path).__enter__()


def test_a_halt_that_neither_keeps_is_reported_and_one_that_the_database_keeps_is_not(
    place: str, tmp_path: Path
) -> None:
    with opened(place) as store, ExitStack() as stack:
        halts_of(place, tmp_path).unlink()
        outcomes = keep(store, STOP)
        stack.enter_context(locked(place))
        store.append([QueuePaused(2, R.STOPPED, "client", 102.0), QueueContinued(3, "client", 1.0)])
        while not any(isinstance(outcome, HaltNotStored) for outcome in outcomes):
            outcomes += next_outcomes(store)
        store.close()
        outcomes += store.take_outcomes()
    at_once, at_last = (each for each in outcomes if isinstance(each, HaltNotStored))
    assert at_once.vehicle == at_last.vehicle == 2
    assert "removed or replaced" in at_once.text
    assert "lost: rover 2: STOP by client" in at_last.text
    found = restored(place)  # a database may write what was sent to it after all, once it may
    assert found.ended_well is (2 in found.paused)


def test_on_a_file_system_that_is_full_the_record_takes_a_stop_and_nothing_else_is_kept() -> None:
    if sys.platform != "linux" or shutil.which("unshare") is None:
        pytest.skip("needs a file system of its own")
    done = subprocess.run(
        [*IN_ITS_OWN_MOUNTS, sys.executable, "-m", "tests.unit.store.full_disk"],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    if done.returncode == NO_NAMESPACE or done.stderr.startswith("unshare:"):
        pytest.skip("this machine gives no file system of one's own")
    assert done.stdout.split() == ["not", "kept", "STOPPED"], done.stderr


def test_a_record_of_the_version_before_is_read(path: Path, record_path: Path) -> None:
    crash(path, STOP, VehicleArmingSet(2, False, 100.0))
    os.truncate(record_path, 98_368)
    found = restored(path)
    assert (found.paused, found.disarmed) == ({1: R.STOPPED}, frozenset({2}))


def test_a_record_with_holes_gets_its_blocks_when_it_is_opened(
    path: Path, record_path: Path
) -> None:
    life(path, STOP)
    content = record_path.read_bytes()
    with record_path.open("wb") as file:  # as a backup that leaves zeros out puts it back
        file.truncate(len(content))
        file.write(content[: content.rindex(b"14550") + 5])
    assert record_path.stat().st_blocks * 512 < len(content)
    assert restored(path).paused == {1: R.STOPPED}
    assert record_path.stat().st_blocks * 512 >= len(content)
