"""The files of a telemetry log."""

import errno
import os
import stat
from pathlib import Path

import pytest

from mav_tasks.errors import RecordError
from mav_tasks.recording.new_files import prepared, write_all
from mav_tasks.recording.tlog_files import TlogFiles

NOON = 1_763_726_400.0  # 2025-11-21T12:00:00Z
FIRST = "2025-11-21T12-00-00Z.tlog"


def packets(count: int, *, of: int = 100) -> list[bytes]:
    return [bytes([number % 256]) * of for number in range(count)]


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_the_next_file_is_begun_before_one_is_too_long(tmp_path: Path) -> None:
    files = TlogFiles(tmp_path, size=250, count=10)
    files.write(packets(5), utc=NOON)
    files.write(packets(1), utc=NOON + 60)
    files.close()
    assert {path.name: path.stat().st_size for path in tmp_path.iterdir()} == {
        FIRST: 200,
        "2025-11-21T12-00-00Z.1.tlog": 200,
        "2025-11-21T12-00-00Z.2.tlog": 200,
    }
    assert files.kept == 6


def test_only_the_oldest_of_ours_are_removed(tmp_path: Path) -> None:
    others = ["notes.tlog", "2025-11-21T12-00-00Z.tlog.old", "2024-01-01T00-00-00Z.raw"]
    for name in [*others, "2024-01-01T00-00-00Z.tlog", "2024-01-01T00-00-00Z.10.tlog"]:
        (tmp_path / name).write_bytes(b"x")
    (tmp_path / "2023-01-01T00-00-00Z.tlog").symlink_to(tmp_path / "notes.tlog")
    (tmp_path / "2023-01-02T00-00-00Z.tlog").mkdir()
    files = TlogFiles(tmp_path, size=100, count=3)
    files.write(packets(2), utc=NOON)
    files.close()
    assert set(names(tmp_path)) == {
        *others,
        "2023-01-01T00-00-00Z.tlog",
        "2023-01-02T00-00-00Z.tlog",
        "2024-01-01T00-00-00Z.10.tlog",
        FIRST,
        "2025-11-21T12-00-00Z.1.tlog",
    }


def test_files_are_their_owners_and_nothing_is_written_over(tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    folder = prepared(str(tmp_path / "a" / "b"))
    (folder / FIRST).symlink_to(elsewhere)
    files = TlogFiles(folder, size=1000, count=10)
    files.write(packets(1), utc=NOON)
    files.close()
    assert not elsewhere.exists()
    made = folder / "2025-11-21T12-00-00Z.1.tlog"
    assert stat.S_IMODE(made.stat().st_mode) == 0o600
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


@pytest.mark.parametrize("sizes", [[250], [0], [100, 250]])
def test_after_a_failure_the_file_goes_on_behind_its_last_whole_packet(
    tmp_path: Path, sizes: list[int]
) -> None:
    room = list(sizes)

    def write(fd: int, data: bytes) -> None:
        if room:
            write_all(fd, data[: room.pop()])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write_all(fd, data)

    files = TlogFiles(tmp_path, size=10_000, count=10, write=write)
    for _ in sizes:
        with pytest.raises(OSError, match="No space"):
            files.write(packets(3), utc=NOON)
    files.write([b"a" * 50], utc=NOON)
    files.close()
    assert (tmp_path / FIRST).read_bytes() == b"a" * 50
    assert (names(tmp_path), files.kept) == ([FIRST], 1)


def test_a_folder_that_cannot_be_made_is_told_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(RecordError, match=r"cannot write records to .*/file/folder: Not a dir"):
        prepared(str(tmp_path / "file" / "folder"))
    with pytest.raises(RecordError, match="not a folder"):
        prepared(str(tmp_path / "file"))


@pytest.mark.parametrize("with_folder", [False, True])
def test_a_log_that_was_removed_is_begun_anew(tmp_path: Path, *, with_folder: bool) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    files = TlogFiles(folder, size=10_000, count=10)
    files.write(packets(1), utc=NOON)
    (folder / FIRST).unlink()
    if with_folder:
        folder.rmdir()
    files.write(packets(2), utc=NOON + 60)
    files.close()
    (path,) = folder.iterdir()
    assert path.stat().st_size == 200


def test_a_folder_is_found_in_the_home_of_who_runs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a file or a variable no shell does that; the store's path is read in the same way."""
    monkeypatch.setenv("HOME", str(tmp_path))
    assert prepared("~/logs") == tmp_path / "logs"
    with pytest.raises(RecordError, match=r"cannot write records to ~nobody\.there/logs: "):
        prepared("~nobody.there/logs")
