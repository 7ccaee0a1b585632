"""Real processes and real files: killed while writing, locked, damaged, read-only, full."""

import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from mav_tasks.errors import StoreError
from mav_tasks.store import Kept
from mav_tasks.store.durable import CLOSE_LIMIT
from mav_tasks.store.writer import LAST_TRY
from mav_tasks.tasks.events import TaskSubmitted
from tests.kit.databases import foreign, newer, tables
from tests.kit.processes import free_udp_ports
from tests.kit.volume import some
from tests.unit.store.samples import (
    FOR_EVER,
    PATIENCE,
    opened,
    submitted,
    wait_for,
    wait_for_failure,
)

ROOT = Path(__file__).resolve().parents[3]
NOBODY = 65534
SERVE = [sys.executable, "-m", "mav_tasks.cli", "serve", "--no-push"]


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
        found = store.load()
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


def test_a_second_store_in_one_process_is_refused_too(place: str) -> None:
    with opened(place), pytest.raises(StoreError, match=rf"pid {os.getpid()}\b"):
        opened(place).__enter__()
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
        ids = [task.id for task in store.load().tasks]
        assert ids == list(range(1, len(ids) + 1))
        assert len(ids) >= through
        assert [number for number, _ in store.journal()] == ids


@pytest.mark.parametrize("way", ["moved away", "another in its place", "its log removed"])
def test_what_is_written_to_a_file_that_is_gone_is_not_kept(path: Path, way: str) -> None:
    with opened(path) as store:
        store.append([submitted(1)])
        wait_for(store, 1)
        away = path.with_name("away")
        if way == "another in its place":
            copy = path.with_name("copy")
            copy.write_bytes(path.read_bytes())
        if way == "its log removed":
            path.with_name(f"{path.name}-wal").unlink()
        else:
            path.rename(away)
        if way == "another in its place":
            copy.rename(path)
        store.append([submitted(2)])
        failure = wait_for_failure(store)
        assert str(path) in failure.text
        assert "removed or replaced" in failure.text
        if way != "its log removed":  # which mends itself: all that was in it is still known
            time.sleep(0.6)  # it tries again, in vain
            assert not any(isinstance(outcome, Kept) for outcome in store.take_outcomes())
            away.rename(path)
        wait_for(store, 2)
    with opened(path) as store:
        assert [task.id for task in store.load().tasks] == [1, 2]


def test_a_file_that_is_gone_for_good_ends_with_what_is_lost_said(path: Path) -> None:
    with opened(path) as store:
        store.append([submitted(1)])
        wait_for(store, 1)
        path.unlink()
        store.append([submitted(2)])
        wait_for_failure(store)
        began = time.monotonic()
        store.close()
    assert time.monotonic() - began < CLOSE_LIMIT + LAST_TRY
    assert not path.exists()  # no new, empty one in its place, which would look as if all was well


def test_a_disk_that_is_full_at_start_is_said(path: Path) -> None:
    done = subprocess.run(
        [*SERVE, "--client", f"udpin:127.0.0.1:{free_udp_ports(1)[0]}", "--store", str(path)],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
        preexec_fn=_no_room,
    )
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
    assert f"store {path}" in done.stderr
    assert "full" in done.stderr


def _no_room() -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192))


def refusal(place: str | Path) -> str:
    with pytest.raises(StoreError) as caught:
        opened(place).__enter__()
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(f"store {place}: ")
    return text


def filled(place: str | Path, *, count: int = 3000) -> None:
    with opened(place, retention=FOR_EVER) as store:
        store.append([submitted(number) for number in range(1, count + 1)])
        wait_for(store, count)


def test_what_is_no_database_is_refused_and_left_alone(path: Path) -> None:
    path.write_bytes(b"no database " * 1000)
    assert "not a database" in refusal(path)
    assert path.read_bytes() == b"no database " * 1000


def test_a_truncated_file_is_refused(path: Path) -> None:
    filled(path)
    os.truncate(path, path.stat().st_size // 2 // 4096 * 4096)
    assert "damaged" in refusal(path)


def test_a_damaged_file_is_refused(path: Path) -> None:
    filled(path)
    with path.open("r+b") as file:
        for page in range(5, 60):
            file.seek(page * 4096)
            file.write(b"\xa5" * 2048)
    assert "damaged" in refusal(path)


def test_rows_that_nobody_wrote_are_refused(place: str) -> None:
    filled(place, count=3)
    with tables(place) as other:
        other.execute("UPDATE tasks SET submitted = '[1, 2]' WHERE id = 2")
    with opened(place) as store, pytest.raises(StoreError, match="its contents are invalid"):
        store.load()


def test_a_newer_schema_is_refused(place: str) -> None:
    filled(place, count=1)
    newer(place)
    assert "newer version" in refusal(place)


def test_another_programs_database_is_refused_and_left_alone(place: str) -> None:
    foreign(place)
    assert "another program" in refusal(place)
    with tables(place) as theirs:
        assert theirs.execute("SELECT * FROM versions").fetchall() == []


def test_a_folder_in_place_of_the_file_is_refused(path: Path) -> None:
    path.mkdir()
    assert "directory" in refusal(path).lower()


def test_a_file_in_place_of_the_folder_is_refused(path: Path) -> None:
    path.write_text("not a folder", encoding="ascii")
    assert "folder" in refusal(path / "tasks.sqlite3")


def test_a_folder_that_cannot_be_made_is_refused() -> None:
    assert "cannot be created" in refusal(Path("/proc/mav-tasks/tasks.sqlite3"))


@contextmanager
def ordinary_user(*owned: Path) -> Iterator[None]:
    """Let the block run without root's rights, whoever runs the tests."""
    if os.geteuid() != 0:
        yield
        return
    for each in owned:
        os.chown(each, NOBODY, NOBODY)
    os.seteuid(NOBODY)
    try:
        yield
    finally:
        os.seteuid(0)


def test_a_read_only_folder_is_refused() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve()
        with ordinary_user(folder):
            folder.chmod(0o500)
            try:
                assert "Permission denied" in refusal(folder / "tasks.sqlite3")
            finally:
                folder.chmod(0o700)


def test_a_read_only_file_is_refused() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve()
        with ordinary_user(folder):
            path = folder / "tasks.sqlite3"
            filled(path, count=1)
            path.chmod(0o400)
            assert "Permission denied" in refusal(path)
