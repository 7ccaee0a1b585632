"""The record of halts: what it keeps when the database keeps nothing, and when it does not."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mav_tasks.errors import StoreError
from mav_tasks.store import HaltNotKept
from mav_tasks.store.halt_record import CELL, HEADER, SIZE, HaltRecord, Word, event_of, word_of
from mav_tasks.store.halt_record import FIRST_ONES as CELLS
from mav_tasks.tasks.events import Event, QueueContinued, QueuePaused, VehicleArmingSet
from mav_tasks.tasks.lifecycle import TaskReason
from tests.kit.databases import database_of, disk_error, halts_of
from tests.unit.store.full_disk import NO_NAMESPACE
from tests.unit.store.samples import next_outcomes, opened, submitted, wait_for

R = TaskReason
IN_ITS_OWN_MOUNTS = ("unshare", "--user", "--map-root-user", "--mount")
ROOT = Path(__file__).resolve().parents[3]
STOP = QueuePaused(1, R.STOPPED, "255/190@127.0.0.1:14550", 100.0)
CONTINUE = QueueContinued(1, "client", 101.0)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "tasks.sqlite3"


@pytest.fixture
def record_path(path: Path) -> Path:
    return path.with_name(f"{path.name}.halts")


@pytest.fixture
def full(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on no database takes anything."""
    refuse_writes(place, monkeypatch)


def refuse_writes(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def write(*_: object, **__: object) -> None:
        raise disk_error(place)

    monkeypatch.setattr(database_of(place), "write", write)
    monkeypatch.setattr("mav_tasks.store.durable.CLOSE_LIMIT", 0.1)


def life(place: str | Path, *events: Event) -> None:
    """Let a store take events, as well as it can, and end."""
    with opened(place) as store:
        store.append(events)


def paused(place: str | Path) -> dict[int, TaskReason]:
    with opened(place) as store:
        return dict(store.load().paused)


def test_a_stop_that_only_the_record_took_is_in_force_in_the_next_life(
    place: str, monkeypatch: pytest.MonkeyPatch, full: None
) -> None:
    life(place, submitted(1), STOP)
    monkeypatch.undo()
    with opened(place) as store:
        found = store.load()
        journal = list(store.journal())
    assert (found.paused, found.ended_well) == ({1: R.STOPPED}, False)
    assert journal == [(3, STOP)]  # 1 and 2 are lost numbers, which no other event gets
    assert paused(place) == {1: R.STOPPED}


def test_the_newest_word_wins_whoever_kept_it(
    place: str, monkeypatch: pytest.MonkeyPatch, full: None
) -> None:
    life(place, STOP, CONTINUE)
    monkeypatch.undo()
    assert paused(place) == {}
    life(place, QueuePaused(1, R.OPERATOR, "client", 102.0))
    assert paused(place) == {1: R.OPERATOR}


def test_a_database_that_knows_more_than_the_record_is_believed(place: str, tmp_path: Path) -> None:
    life(place, STOP)
    record_path = halts_of(place, tmp_path)
    older = record_path.read_bytes()
    life(place, CONTINUE)
    record_path.write_bytes(older)
    assert paused(place) == {}


def test_an_older_database_put_back_forgets_no_stop_and_gives_no_id_twice(path: Path) -> None:
    life(path, submitted(1))
    older = path.read_bytes()
    life(path, *map(submitted, range(2, 8)), STOP)
    path.write_bytes(older)
    with opened(path) as store:
        found = store.load()
    assert ([task.id for task in found.tasks], found.next_id) == ([1], 8)
    assert (found.paused, found.ended_well) == ({1: R.STOPPED}, False)


def test_a_word_that_is_cut_short_leaves_the_one_before(path: Path) -> None:
    record = HaltRecord(path, name=str(path))
    for number in (1, 2, 3):
        record.write(Word(9, number, R.STOPPED, "ä" * 40, 5.0))
    record.close()
    damage(path, slot=0, vehicle=9)
    assert [word.number for word in words(path)] == [2]
    assert words(path)[0].actor == "ä" * 19
    damage(path, slot=1, vehicle=9)
    with pytest.raises(StoreError, match="damaged"):
        HaltRecord(path, name=str(path))


def words(path: Path) -> list[Word]:
    record = HaltRecord(path, name=str(path))
    record.close()
    return record.words_after(0)


def damage(path: Path, *, slot: int, vehicle: int) -> None:
    with path.with_name(f"{path.name}.halts").open("r+b") as file:
        file.seek(len(HEADER) + (slot * CELLS + vehicle) * CELL + 20)
        file.write(b"\xa5")


@pytest.mark.parametrize("content", [b"", b"something else\n" * 4000, bytes(SIZE)])
def test_what_is_no_record_is_refused_in_one_line(
    path: Path, record_path: Path, content: bytes
) -> None:
    record_path.write_bytes(content)
    with pytest.raises(StoreError) as caught:
        opened(path).__enter__()
    assert str(caught.value).startswith(f"store {path}: {record_path.name}: it is damaged")
    assert record_path.read_bytes() == content
    record_path.unlink()
    assert paused(path) == {}  # nothing of the refused store holds on to its lock


def test_a_record_that_is_a_link_is_not_followed(path: Path, record_path: Path) -> None:
    record_path.symlink_to("/etc/passwd")
    with pytest.raises(StoreError, match="symbolic link"):
        opened(path).__enter__()


def test_a_record_with_holes_gets_its_blocks_when_it_is_opened(
    path: Path, record_path: Path
) -> None:
    life(path, STOP)
    content = record_path.read_bytes()
    with record_path.open("wb") as file:  # as a backup that leaves zeros out puts it back
        file.truncate(SIZE)
        file.write(content[: content.rindex(b"14550") + 5])
    assert record_path.stat().st_blocks * 512 < SIZE
    assert paused(path) == {1: R.STOPPED}
    assert record_path.stat().st_blocks * 512 >= SIZE


def test_a_halt_that_neither_keeps_is_reported_and_one_that_the_database_keeps_is_not(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mav_tasks.store.halt_keeper.GRACE", 0.3)
    with opened(place) as store:
        halts_of(place, tmp_path).unlink()
        store.append([STOP])
        outcomes = wait_for(store, 1)
        refuse_writes(place, monkeypatch)
        store.append([QueuePaused(2, R.STOPPED, "client", 102.0), QueueContinued(3, "client", 1.0)])
        while not any(isinstance(outcome, HaltNotKept) for outcome in outcomes):
            outcomes += next_outcomes(store)
        store.close()
        outcomes += store.take_outcomes()
    told = [outcome for outcome in outcomes if isinstance(outcome, HaltNotKept)]
    assert [each.vehicle for each in told] == [2, 2]
    assert "removed or replaced" in told[0].text
    assert "lost: rover 2: STOP by client" in told[1].text
    monkeypatch.undo()
    with opened(place) as store:
        assert not store.load().ended_well


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


def test_the_latest_task_id_counts_though_a_higher_one_came_before(path: Path) -> None:
    record = HaltRecord(path, name=str(path))
    record.note_next_id(16_777_215, number=10)
    record.note_next_id(2, number=20)
    record.close()
    again = HaltRecord(path, name=str(path))
    again.close()
    assert [again.next_id_after(number) for number in (9, 19, 20)] == [2, 2, None]


def test_that_somebody_has_disarmed_is_a_word_and_an_older_record_is_made_longer(
    path: Path, record_path: Path
) -> None:
    record = HaltRecord(path, name=str(path))
    record.write(Word(9, 1, R.STOPPED, "somebody", 5.0))
    record.close()
    record_path.write_bytes(record_path.read_bytes()[: len(HEADER) + 2 * CELLS * CELL])
    older = HaltRecord(path, name=str(path))
    disarming = word_of(VehicleArmingSet(9, False, 7.0), 2, offset=1.0)
    assert disarming is not None
    older.write(disarming)
    older.close()
    assert record_path.stat().st_size == SIZE
    assert [event_of(word, offset=1.0) for word in words(path)] == [
        QueuePaused(9, R.STOPPED, "somebody", 4.0),
        VehicleArmingSet(9, False, 7.0),
    ]
