"""Real processes and real files: killed while writing, locked, damaged, read-only, full."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from mav_tasks.basics.errors import StoreError
from mav_tasks.tasks.events import TaskSubmitted
from tests.kit.databases import foreign, newer, tables
from tests.kit.volume import some
from tests.unit.store.samples import (
    PATIENCE,
    keep,
    loaded,
    opened,
    submitted,
    wait_for,
    wait_for_failure,
)

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "tasks.sqlite3"


@contextmanager
def child(*arguments: object) -> Iterator["subprocess.Popen[str]"]:
    """Run the submitting process; it is killed after the block."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.unit.store.child", *map(str, arguments)],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert line(process) == "open"
        yield process
    finally:
        process.kill()
        process.wait(PATIENCE)
        for stream in (process.stdin, process.stdout):
            assert stream is not None
            stream.close()


def line(process: "subprocess.Popen[str]") -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def kept(process: "subprocess.Popen[str]", *, at_least: int) -> int:
    """Read until so many are kept; gives how many."""
    through = 0
    while through < at_least:
        word, _, number = line(process).partition(" ")
        through = int(number) if word == "kept" else through
    return through


@pytest.mark.parametrize("life", some([1, 40, 400], 0, 1))
def test_what_was_kept_outlives_the_process(place: str, life: int) -> None:
    through = 0
    for _ in range(3):
        with child(place) as process:
            through = kept(process, at_least=through + life)
            process.send_signal(signal.SIGKILL)
            process.wait(PATIENCE)
            assert process.stdout is not None
            for rest in process.stdout:  # said before it was killed
                through = int(rest.split()[1])
    with opened(place) as store:
        found = loaded(store)
        assert not found.ended_well
        ids = [task.id for task in found.tasks]
        assert ids == list(range(1, len(ids) + 1))
        assert len(ids) >= through
        assert found.next_id == len(ids) + 1
        journal = list(store.journal())
        assert [n for n, _ in journal] == ids
        assert [e.task for _, e in journal if isinstance(e, TaskSubmitted)] == list(found.tasks)


def test_a_store_in_use_is_refused_with_the_process(place: str) -> None:
    with child(place) as process:
        with pytest.raises(StoreError, match=rf"in use by .*, pid {process.pid}\b"):
            opened(place).__enter__()
        process.send_signal(signal.SIGKILL)
        process.wait(PATIENCE)
        with opened(place):
            pass


def test_a_full_disk_is_said_and_nothing_is_lost_over_it(path: Path) -> None:
    with child(path, 200_000) as process:
        said = ""
        through = 0
        while not said.startswith("store"):
            said = line(process)
            if said.startswith("kept"):
                through = int(said.split()[1])
        assert str(path) in said
        assert "full" in said
        time.sleep(1.0)  # it tries again, in vain, and may not give up
        assert process.stdin is not None
        process.stdin.write("lift\n")
        process.stdin.flush()
        through = kept(process, at_least=through + 500)
    with opened(path) as store:
        ids = [task.id for task in loaded(store).tasks]
        assert ids == list(range(1, len(ids) + 1))
        assert len(ids) >= through
        assert [number for number, _ in store.journal()] == ids


def test_a_file_that_is_gone_for_good_ends_with_what_is_lost_said(path: Path) -> None:
    with opened(path) as store:
        store.append([submitted(1)])
        wait_for(store, 1)
        path.unlink()
        store.append([submitted(2)])
        wait_for_failure(store)
        began = time.monotonic()
        store.close()
    assert time.monotonic() - began < 5.0
    assert not path.exists()  # no new, empty one in its place, which would look as if all was well


def no_database(path: Path) -> None:
    path.write_bytes(b"no database " * 1000)


def truncated(path: Path) -> None:
    filled(path)
    os.truncate(path, path.stat().st_size // 2 // 4096 * 4096)


def damaged(path: Path) -> None:
    filled(path)
    with path.open("r+b") as file:
        for page in range(5, 60):
            file.seek(page * 4096)
            file.write(b"\xa5" * 2048)


def filled(path: Path) -> None:
    with opened(path) as store:
        store.append([submitted(number) for number in range(1, 3001)])


def of_a_newer_version(path: Path) -> None:
    filled(path)
    newer(str(path))


def of_another_program(path: Path) -> None:
    foreign(str(path))


def another_file(path: Path) -> None:
    path.parent.rmdir()
    path.parent.write_text("not a folder", encoding="ascii")


EDITED = """UPDATE tasks SET submitted = '[1, 2]' => its contents are invalid
UPDATE tasks SET submitted = 'x' => it is damaged (expecting value
UPDATE tasks SET submitted = replace(submitted, 'Move', 'Dance') => 'dance'
UPDATE formats SET names = '{}' => has another format
INSERT INTO vehicles (vehicle, paused) VALUES (1, 999) => it is damaged (999
DROP TABLE plans => no such table: plans
DROP TABLE writer => a table has lost its row"""


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (no_database, "not a database"),
        (truncated, "damaged"),
        (damaged, "damaged"),
        *(row.split(" => ") for row in EDITED.splitlines()),
        (of_a_newer_version, "newer version"),
        (of_another_program, "another program"),
        (Path.mkdir, "directory"),
        (another_file, "folder"),
    ],
)
def test_what_is_no_store_is_refused_in_one_line_and_left_alone(
    tmp_path: Path, spoil: Callable[[Path], None] | str, words: str
) -> None:
    path = tmp_path / "folder" / "tasks.sqlite3"
    path.parent.mkdir()
    if not isinstance(spoil, str):
        spoil(path)
    else:  # a statement, for a store of this version
        with opened(path) as store:
            keep(store, submitted(1))
        with tables(str(path)) as other:
            other.execute(spoil)
    before = path.read_bytes() if path.is_file() else b""
    with pytest.raises(StoreError) as told, opened(path) as store:
        loaded(store)
    assert str(told.value).startswith(f"store {path}: ")
    assert words in str(told.value).lower()
    assert "\n" not in str(told.value)
    if not isinstance(spoil, str):  # what is opened first is the server's
        assert before == (path.read_bytes() if path.is_file() else b"")
