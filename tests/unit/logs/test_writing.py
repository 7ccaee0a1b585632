"""The log's way out: whoever logs never waits, and what is lost is counted."""

import fcntl
import logging
import os
import re
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from mav_tasks.logs import writing
from mav_tasks.logs.lines import Lines
from mav_tasks.logs.writing import ThreadedHandler

PATIENCE = 20.0


def words_only(record: logging.LogRecord, words: str, repeated: tuple[int, float] | None) -> str:
    return words + (f" ({repeated[0]} more)" if repeated else "")


def say(handler: logging.Handler, words: str) -> None:
    handler.handle(logging.makeLogRecord({"msg": words, "levelno": 20, "levelname": "INFO"}))


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    """A pipe that is full: whoever writes to it waits."""
    read, write = os.pipe()
    os.set_blocking(write, False)
    fcntl.fcntl(write, fcntl.F_SETPIPE_SZ, 4096)
    while True:
        try:
            os.write(write, b"x" * 4096)
        except BlockingIOError:
            break
    os.set_blocking(write, True)
    yield read, write
    for fd in (read, write):
        os.close(fd)


def read_until(fd: int, words: str) -> str:
    """Read, by a thread that is not ours to wait for, until something was read."""
    data = b""
    end = time.monotonic() + PATIENCE
    while words.encode() not in data:
        assert time.monotonic() < end, data[-500:]
        data += os.read(fd, 4096)
    return data.decode().lstrip("x")


def test_who_logs_does_not_wait_for_a_pipe_that_nobody_reads(
    pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writing, "MOST", 100)
    read, write = pipe
    handler = ThreadedHandler(write, Lines(words_only))
    for number in range(2_000):  # more than the pipe takes: who waited would wait for ever
        say(handler, f"line {number}")
    # read at last: what waited comes, and how many lines did not
    lost = int(repr(handler).split(", ")[1].split(" ")[0])
    said = read_until(read, "lost: ")
    # the number may come before the last lines
    while sum(counts := lost_in(said)) + len(lines_in(said)) < 2_000:
        said += read_until(read, "\n")
    assert said.startswith("line 0\nline 1\n")
    assert sum(counts) == lost
    handler.close()


def lost_in(said: str) -> list[int]:
    return list(map(int, re.findall(r"lost: (\d+) \(", said)))


def lines_in(said: str) -> list[str]:
    return re.findall(r"^line \d+$", said, re.MULTILINE)


def test_the_end_waits_a_moment_for_who_does_not_read(
    pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writing, "LAST_WORDS", 0.2)
    read, write = pipe
    handler = ThreadedHandler(write, Lines(words_only))
    say(handler, "never read")
    began = time.monotonic()
    handler.close()
    assert 0.2 <= time.monotonic() - began < 2.0
    read_until(read, "never read\n")  # or the thread would have the descriptor for ever


def test_the_end_writes_what_is_left_and_what_was_counted(tmp_path: Path) -> None:
    path = tmp_path / "log"
    with path.open("wb") as file:
        handler = ThreadedHandler(file.fileno(), Lines(words_only))
        for number in range(5_000):
            say(handler, f"line {number}")
        for _ in range(3):
            say(handler, "again")
        handler.close()
        handler.close()
    lines = path.read_text().splitlines()
    assert lines == [*(f"line {number}" for number in range(5_000)), "again", "again (2 more)"]


def test_a_full_disk_costs_lines_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(writing, "RETRY", 0.01)
    with Path("/dev/full").open("wb", buffering=0) as full:
        handler = ThreadedHandler(full.fileno(), Lines(words_only))
        for number in range(50):
            say(handler, f"line {number}")
        handler.close()
    assert repr(handler) == "ThreadedHandler(0 waiting, 50 lost)"


def test_after_a_failure_a_line_begins_at_its_beginning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writing, "RETRY", 0.01)
    path, is_torn = tmp_path / "log", threading.Event()
    write = os.write

    def torn(fd: int, data: bytes) -> int:
        """Half of the first line is written, then the disk is full for one write."""
        if is_torn.is_set():
            return write(fd, data)
        if bytes(data).startswith(b"first"):
            return write(fd, bytes(data)[:3])
        is_torn.set()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "write", torn)
    with path.open("wb") as file:
        handler = ThreadedHandler(file.fileno(), Lines(words_only))
        say(handler, "first")
        assert is_torn.wait(PATIENCE)
        say(handler, "second")
        handler.close()
    assert path.read_text() == (
        "fir\nsecond\nlog lines lost: 1 (the reader or the disk was too slow)\n"
    )


def test_a_pipe_that_somebody_made_non_blocking_is_waited_for(pipe: tuple[int, int]) -> None:
    read, write = pipe
    os.set_blocking(write, False)
    handler = ThreadedHandler(write, Lines(words_only))
    say(handler, "at last")
    read_until(read, "at last\n")
    handler.close()
    assert "0 lost" in repr(handler)


def test_what_cannot_be_rendered_is_told_and_the_rest_is_said(tmp_path: Path) -> None:
    path = tmp_path / "log"
    with path.open("wb") as file:
        handler = ThreadedHandler(file.fileno(), Lines(words_only))
        handler.handle(logging.makeLogRecord({"msg": "%d", "args": ("no number",)}))
        say(handler, "fine \udcff é")
        handler.close()
    first, second = path.read_text(encoding="utf-8").splitlines()
    assert first.startswith("a log line cannot be formatted: TypeError(")
    assert second == "fine  é"
