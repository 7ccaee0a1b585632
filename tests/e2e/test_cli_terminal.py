"""The command line at a terminal: what it looks like, whatever the terminal is, and Ctrl-C."""

import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest

from mav_tasks import Move, Refused, SyncClient, TaskState, Wait
from tests.kit.processes import Stand, wait_until
from tests.kit.terminal import CTRL_C, Terminal, terminal

ESCAPE = b"\x1b"
COLOUR = re.compile(rb"\x1b\[[0-9;]*m")
SHOWN_CURSOR, OLD_SCREEN = b"\x1b[?25h", b"\x1b[?1049l"


@pytest.fixture(scope="module")
def opened(there: Stand) -> Iterator[SyncClient]:
    with SyncClient(url_of(there), component_id=99) as client:
        yield client


@pytest.fixture
def client(opened: SyncClient) -> Iterator[SyncClient]:
    """A client besides the command line; nothing of a test is left behind."""
    yield opened
    opened.clear(running_too=True)
    wait_until(lambda: opened.queue().running is None, within=10, what="nothing that runs")
    with suppress(Refused):
        opened.resume()


def url_of(there: Stand) -> str:
    return f"udpout:127.0.0.1:{there.client_port}"


@contextmanager
def at(
    there: Stand, *arguments: str, size: tuple[int, int] = (24, 80), **environment: str
) -> Iterator[Terminal]:
    surroundings = {"MAV_TASKS_SERVER": url_of(there), **environment}
    command = ("-m", "mav_tasks.cli", *arguments)
    with terminal(*command, size=size, environment=surroundings) as running:
        yield running


def test_a_task_that_is_waited_for_is_one_line_that_moves(there: Stand, client: SyncClient) -> None:
    with at(there, "submit", "wait", "2s", "--wait") as screen:
        percents = set[str]()

        def is_over(text: str) -> bool:
            percents.update(re.findall(r"executing .*━.* (\d+) % +\d\.\d s", text))
            return "completed" in text

        screen.wait_for(is_over)
        assert screen.end() == 0
    assert len(percents) >= 3
    task, over = screen.lines
    assert over.startswith(f"{task}: wait 2 s: completed, in 2")
    assert COLOUR.search(screen.written)
    assert screen.written.count(SHOWN_CURSOR) >= 1


@pytest.mark.parametrize("command", [("status", "{}", "--wait"), ("queue", "--watch")])
def test_a_dumb_terminal_gets_plain_lines(
    there: Stand, client: SyncClient, command: tuple[str, ...]
) -> None:
    client.pause()
    task = client.submit(Move(1.0))
    command = tuple(word.format(task.id) for word in command)
    with at(there, *command, TERM="dumb") as screen:
        screen.wait_for(lambda text: "queue paused" in text)
        task.cancel()
        screen.wait_for(lambda text: "cancelled" in text)
        if "--watch" in command:
            screen.type(CTRL_C)
        assert screen.end() == (130 if "--watch" in command else 1)
    assert ESCAPE not in screen.written


def test_ctrl_c_leaves_the_task_and_says_how_to_call_it_off(
    there: Stand, client: SyncClient
) -> None:
    with at(there, "submit", "wait", "60s", "--wait") as screen:
        screen.wait_for(lambda text: "executing" in text)
        screen.type(CTRL_C)
        assert screen.end() == 130
    number = int(screen.lines[0].removeprefix("rover 1: task "))
    assert screen.lines[-1] == (
        f"mav-tasks: rover 1: task {number} is not cancelled; "
        f"to cancel it: mav-tasks cancel {number}"
    )
    assert "Traceback" not in screen.text
    assert screen.written.rstrip().endswith(str(number).encode())
    assert client.status(number).state is TaskState.EXECUTING


def test_a_watched_queue_fits_its_window_and_follows_it(there: Stand, client: SyncClient) -> None:
    client.pause()
    tasks = [client.submit(Move(1.0), delay=600.0 + number) for number in range(30)]
    with at(there, "queue", "--watch", size=(12, 80)) as screen:
        screen.wait_for(lambda text: "and 22 more" in text)
        assert len(screen.lines) == 12
        assert screen.lines[0].startswith(
            "rover 1: no task runs; queue paused (operator); to let it run, use:"
        )
        assert screen.lines[1].startswith("30 scheduled")
        screen.resize(8, 40)
        screen.wait_for(lambda text: "and 26 more" in text)
        assert len(screen.lines) == 8
        assert screen.lines[2].split()[:3] == ["id", "state", "goal"]
        tasks[0].cancel()
        screen.wait_for(lambda text: "and 25 more" in text)
        screen.resize(40, 120)
        screen.wait_for(lambda text: str(tasks[-1].id) in text and "more" not in text)
        screen.type(CTRL_C)
        assert screen.end() == 130
    assert screen.written.rstrip().endswith(OLD_SCREEN)
    assert SHOWN_CURSOR in screen.written
    assert b"Traceback" not in screen.written


def test_to_call_off_everything_is_asked_about(there: Stand, client: SyncClient) -> None:
    task = client.submit(Wait(60.0))
    with at(there, "clear", "--all") as screen:
        screen.wait_for(lambda text: "also those that have begun? [y/N]:" in text)
        screen.type(b"n\n")
        assert screen.end() == 2
    assert screen.lines[-1].strip() == "mav-tasks: nothing was cancelled"
    assert not client.status(task.id).is_over
    with at(there, "clear", "--all") as screen:
        screen.wait_for(lambda text: "[y/N]:" in text)
        screen.type(b"y\n")
        assert screen.end() == 0
    wait_until(lambda: client.status(task.id).is_over, within=10)
