"""Tests of who watches whether the machine stands still, with a watcher that is held up itself."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from time import monotonic, sleep

import pytest

from tests.kit.processes import wait_until
from tests.kit.stalls import STALL, StallWatch


@pytest.fixture
def watch() -> Iterator[StallWatch]:
    with closing(StallWatch()) as it:
        yield it


def hold_up(watch: StallWatch, seconds: float) -> None:
    """Keep the watcher from running, as a machine does that stands still."""
    os.kill(watch.pid, signal.SIGSTOP)
    sleep(seconds)  # what is tried
    os.kill(watch.pid, signal.SIGCONT)


def test_a_stall_is_told_with_its_time(watch: StallWatch) -> None:
    before = monotonic()
    hold_up(watch, 2 * STALL)
    after = monotonic()
    (stall,) = wait_until(lambda: watch.since(before), within=10, what="the stall")
    assert stall.begin <= before + 0.1
    assert stall.end >= before + 2 * STALL
    assert not watch.since(max(after, stall.end))


def test_a_disk_that_does_not_answer_is_a_stall() -> None:
    program = f"""
import os, time
from tests.kit import stalls
os.fsync = lambda _: time.sleep({2 * STALL})
stalls.watch()
"""
    command = [sys.executable, "-c", program]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as watcher:
        assert watcher.stdout is not None
        assert watcher.stdout.readline() == "\n"
        begin, end = map(float, watcher.stdout.readline().split())
        watcher.kill()
    assert end - begin >= 2 * STALL


def test_a_watcher_that_ended_is_no_quiet_machine(watch: StallWatch) -> None:
    os.kill(watch.pid, signal.SIGKILL)
    with pytest.raises(RuntimeError, match="has ended"):
        wait_until(lambda: watch.since(0.0), within=10, what="the error")
