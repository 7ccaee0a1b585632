"""Show a task until it ends: one updated line on a terminal, else a line or JSON per change."""

import asyncio
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.console import Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text as Line

from mav_tasks.cli import output, words
from mav_tasks.cli.options import Common
from mav_tasks.cli.session import is_alone
from mav_tasks.client.aio import Client
from mav_tasks.client.descriptions import state_of, why_of
from mav_tasks.client.handle import Task
from mav_tasks.client.json_form import task_json
from mav_tasks.client.values import News, TaskStatus, Text

LOOK = 0.5  # s between two checks for silence
BAR_WIDTH = 30  # columns at most
BAR_FROM = 60  # columns; a narrower window has no bar


class View(Protocol):
    """An output for a task's progress."""

    def show(self, status: TaskStatus) -> None:
        """Show a new status."""

    def silence(self, *, is_silent: bool) -> None:
        """Show whether the rover and its server are silent."""


async def follow(client: Client, task: Task, common: Common) -> None:
    """Show a task until it has ended. Raise TaskFailed unless it completed."""
    about, said = re.compile(rf"of task {task.id}\b"), list[str]()

    def listen(news: News) -> None:
        if isinstance(news, Text) and about.search(news.words):
            said.append(news.words)

    try:
        with client.listening(listen), _view(client, task.vehicle, common) as view:
            looking = asyncio.create_task(_look(client, task, view))
            try:
                async for status in task.updates():
                    view.show(status)
            finally:
                looking.cancel()
    except asyncio.CancelledError:
        name = f"rover {task.vehicle}: task {task.id}"
        goes_on = f"{name} is not cancelled; to cancel it: mav-tasks cancel {task.id}"
        sys.stderr.write(f"mav-tasks: {goes_on}\n")
        raise
    for words_of_it in said:  # such as a rover's answer to an act
        output.warn(words_of_it)
    await task.done()


async def _look(client: Client, task: Task, view: View) -> None:
    while True:
        heard = [each.is_heard for each in client.vehicles() if each.id == task.vehicle]
        view.silence(is_silent=heard != [True])
        await asyncio.sleep(LOOK)


@contextmanager
def _view(client: Client, rover: int, common: Common) -> Iterator[View]:
    alone = is_alone(client, common)
    if common.json:
        yield Objects()
    elif not output.is_drawn_on():
        yield Lines(rover, is_alone=alone)
    else:
        bar = Bar(is_alone=alone)
        with Live(
            console=output.console(), auto_refresh=False, transient=True, get_renderable=bar.drawn
        ) as live:
            bar.live = live
            yield bar
        if bar.status is not None and bar.status.is_over:
            output.say(words.line_of(bar.status))


class Lines:
    """Prints the status line when it changes, and when the rover falls silent or returns."""

    def __init__(self, rover: int, *, is_alone: bool) -> None:
        self._rover = rover
        self._is_alone = is_alone
        self._told = ""
        self._is_silent = False

    def show(self, status: TaskStatus) -> None:
        """Print a status whose line has changed."""
        line = words.line_of(status, is_alone=self._is_alone)
        if line != self._told:
            self._told = line
            output.say(line)

    def silence(self, *, is_silent: bool) -> None:
        """Print a change between silent and heard."""
        if is_silent != self._is_silent:
            self._is_silent = is_silent
            output.say(f"rover {self._rover}: {'silent' if is_silent else 'heard again'}")


class Objects:
    """Prints a JSON object at each change of state, reason, progress or item."""

    def __init__(self) -> None:
        self._told: tuple[object, ...] = ()

    def show(self, status: TaskStatus) -> None:
        """Print a status that has changed."""
        told = (status.state, status.reason, status.progress, status.item)
        if told != self._told:
            self._told = told
            output.say_json(task_json(status))

    def silence(self, *, is_silent: bool) -> None:
        """Print nothing: a program detects silence itself."""


class Bar:
    """A progress line that is redrawn in place."""

    def __init__(self, *, is_alone: bool) -> None:
        self.status: TaskStatus | None = None
        self._is_alone = is_alone
        self.live: Live | None = None
        self._is_silent = False

    def show(self, status: TaskStatus) -> None:
        """Redraw with a new status."""
        self.status = status
        self._draw()

    def silence(self, *, is_silent: bool) -> None:
        """Show or hide "rover silent"; this also adapts to a resized window."""
        self._is_silent = is_silent
        self._draw()

    def drawn(self) -> Table | Group:
        """Return the line, fitted to the window, and below it what a person can do."""
        width = 80 if self.live is None else self.live.console.width
        grid = Table.grid(padding=(0, 1), expand=False)
        if self.status is None:
            grid.add_row("")
            return grid
        status = self.status
        state = state_of(status)
        why = "rover silent" if self._is_silent else why_of(status)
        cells: list[str | ProgressBar] = [words.name_of(status), state]
        if width >= BAR_FROM:
            done = status.progress or 0.0
            cells.append(ProgressBar(total=1.0, completed=done, width=min(BAR_WIDTH, width // 3)))
        cells += [words.percent_of(status), words.left_of(status), why]
        for _ in cells:
            grid.add_column(no_wrap=True, overflow="ellipsis")
        grid.add_row(*cells)
        way_on = words.way_on_of(status, is_alone=self._is_alone)
        return Group(grid, Line(way_on)) if way_on else grid

    def _draw(self) -> None:
        assert self.live is not None, "it is set before anything is shown"
        self.live.refresh()
