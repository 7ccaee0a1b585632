"""A store has one writer, whatever happens to its files: real processes on real files.

Each case does something to the files of a running server and starts a second server. The second is
refused, or the first says that it can store nothing any more, and acknowledges nothing after that.
"""

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from mav_tasks.basics.errors import StoreError
from tests.kit.databases import tables
from tests.unit.store.samples import (
    PATIENCE,
    loaded,
    opened,
    submitted,
    wait_for,
    wait_for_failure,
)
from tests.unit.store.test_failures import ROOT, child, kept, line

SOME = 30  # tasks
REFUSALS = 500  # of which each may meet a write of the server
MANY = 1500  # tasks, for which the log is written back to the file


@pytest.fixture
def path(tmp_path: Path) -> Path:
    folder = tmp_path / "folder"
    folder.mkdir()
    return folder / "tasks.sqlite3"


def lock_deleted(path: Path) -> Path:
    for each in path.parent.glob("*.lock"):
        each.unlink()
    return path


def hard_linked(path: Path) -> Path:
    other = path.with_name("other.sqlite3")
    os.link(path, other)
    return other


def linked(path: Path) -> Path:
    other = path.with_name("other.sqlite3")
    other.symlink_to(path)
    return other


def renamed(path: Path) -> Path:
    return path.rename(path.with_name("other.sqlite3"))


def folder_moved(path: Path) -> Path:
    path.parent.rename(path.parent.with_name("elsewhere"))
    return path.parent.with_name("elsewhere") / path.name


def replaced(path: Path) -> Path:
    copy = path.with_name("copy")
    shutil.copyfile(path, copy)
    copy.rename(path)
    return path


def another_copied_over(path: Path) -> Path:
    with opened(path.with_name("another.sqlite3")) as another:
        another.append([submitted(number) for number in range(1, 100)])
    shutil.copyfile(path.with_name("another.sqlite3"), path)
    return path


def another_copied_over_in_a_checkpoint(path: Path) -> Path:
    another_copied_over(path.with_name("before"))
    before = path.stat().st_mtime_ns
    while path.stat().st_mtime_ns == before:
        pass
    return shutil.copyfile(path.with_name("before"), path)


def second(place: Path) -> str:
    """Start a second server; return what it says if it is refused, "" if it begins."""
    done = subprocess.Popen(
        [sys.executable, "-m", "tests.unit.store.child", str(place)],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        if line(done) == "open":
            return ""
        said = done.communicate(timeout=PATIENCE)[1]
        return said.splitlines()[-1]
    finally:
        done.kill()
        done.communicate(timeout=PATIENCE)


def found(place: Path) -> list[int]:
    with opened(place) as store:
        return [task.id for task in loaded(store).tasks]


def end(process: "subprocess.Popen[str]") -> list[str]:
    """Kill a server; return the rest of its lines."""
    process.send_signal(signal.SIGKILL)
    process.wait(PATIENCE)
    assert process.stdout is not None
    return [each.strip() for each in process.stdout]


@pytest.mark.parametrize("deed", [lock_deleted, hard_linked, linked])
def test_a_second_server_is_refused_and_the_first_goes_on(
    path: Path, deed: Callable[[Path], Path]
) -> None:
    with child(path) as process:
        kept(process, at_least=SOME)
        place = deed(path)
        said = second(place)
        rest = end(process)
    assert f"in use by the server on {socket.gethostname()}, pid {process.pid}, since" in said
    if deed is hard_linked:  # SQLite's log is beside the other name
        assert "another name (a hard link)" in second(place)
        place.unlink()
    assert rest, "it went on"
    assert {each.split()[0] for each in rest} == {"kept"}
    assert len(found(path)) >= int(rest[-1].split()[1])


def test_who_is_refused_is_told_by_whom_also_while_that_one_writes(path: Path) -> None:
    said = set()
    with child(path) as process:
        kept(process, at_least=SOME)
        for _ in range(REFUSALS):
            with pytest.raises(StoreError) as refused, opened(path):
                pass
            said.add(str(refused.value).partition(", since")[0])
    place = f"in use by the server on {socket.gethostname()}, pid {process.pid}"
    assert said == {f"store {path}: {place}"}


@pytest.mark.parametrize(
    "deed",
    [renamed, folder_moved, replaced, another_copied_over, another_copied_over_in_a_checkpoint],
)
def test_a_server_whose_file_is_no_longer_the_one_that_people_find_says_so_and_keeps_nothing(
    path: Path, deed: Callable[[Path], Path]
) -> None:
    with child(path) as process:
        through = kept(process, at_least=SOME)
        place = deed(path)
        said = line(process)
        while said.startswith("kept"):
            through = int(said.split()[1])
            said = line(process)
        refused = second(place)
        time.sleep(0.6)  # it tries again, in vain
        rest = end(process)
    assert f"store {path}: another file was copied over it" in said or "replaced" in said
    assert not [each for each in rest if each.startswith("kept")]
    assert "in use by" in refused
    if deed in (renamed, folder_moved):
        assert len(found(place)) >= through


def test_an_older_copy_of_the_same_life_put_back_in_place_is_noticed(path: Path) -> None:
    with child(path) as process:
        through = kept(process, at_least=SOME)
        shutil.copyfile(path, path.with_name("copy"))
        through = kept(process, at_least=through + MANY)
        shutil.copyfile(path.with_name("copy"), path)
        while line(process).startswith("kept"):
            pass
        assert second(path)
        assert not [each for each in end(process) if each.startswith("kept")]


def test_a_server_that_has_nothing_to_write_notices_it_too(path: Path) -> None:
    with opened(path) as store:
        away = path.rename(path.with_name("away"))
        assert str(path) in wait_for_failure(store).text
        away.rename(path)
        store.append([submitted(1)])
        wait_for(store, 1)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        ("writer SET epoch = epoch + 1", "has taken the store over"),
        ("meta SET last_number = 99", "another file was copied over it"),
    ],
)
def test_a_server_after_which_another_has_written_says_so(
    path: Path, spoil: str, words: str
) -> None:
    with opened(path) as store, tables(str(path)) as other:
        other.execute(f"UPDATE {spoil}")
        store.append([submitted(1)])
        assert words in wait_for_failure(store).text


def test_what_was_copied_over_it_is_left_as_it_is(path: Path) -> None:
    with opened(path) as store:
        store.append([submitted(1)])
        wait_for(store, 1)
        another_copied_over(path)
        store.append([submitted(2)])
        assert "another file was copied over it" in wait_for_failure(store).text
        content = path.read_bytes()
    assert path.read_bytes() == content
    for name in ("-wal", "-shm"):  # as it has said
        path.with_name(f"{path.name}{name}").unlink()
    with pytest.raises(StoreError, match=r"halts: it is the record of another store's halts"):
        found(path)
    path.with_name(f"{path.name}.halts").unlink()
    assert len(found(path)) == 99
