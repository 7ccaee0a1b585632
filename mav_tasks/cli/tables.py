"""Queues and rovers as tables that fit a width."""

from collections.abc import Callable, Sequence
from math import degrees, inf
from typing import NamedTuple

from rich.cells import cell_len
from rich.console import Group
from rich.table import Table
from rich.text import Text

from mav_tasks.cli import words
from mav_tasks.cli.times import format_duration
from mav_tasks.client.values import QueueStatus, TaskStatus, VehicleStatus
from mav_tasks.tasks.lifecycle import TaskState

GAP = 2  # columns between two columns
LEAST_ROWS = 4  # below the first line, for a second one above the table
LEAST_WORDS = 10  # columns that a column of words has at the least, if it needs them
GOOD_WORDS = 24  # that it has before a column of numbers is added
STYLES = {
    TaskState.EXECUTING: "green",
    TaskState.STARTING: "green",
    TaskState.PAUSED: "yellow",
    TaskState.CANCELLING: "yellow",
    TaskState.HELD: "red",
}


class Column(NamedTuple):
    """A column: its cells, and its place among those for which there may be no room, 0: always."""

    name: str
    cell: Callable[[TaskStatus], str]
    worth: int = 0
    is_words: bool = False  # may be cut short
    is_right: bool = False


def _starts(status: TaskStatus) -> str:
    seconds = status.time_to_start
    return format_duration(seconds) if seconds and status.is_waiting else ""


COLUMNS = (
    Column("id", lambda s: str(s.id), is_right=True),
    Column("prio", lambda s: str(s.priority), worth=3, is_right=True),
    Column("state", words.state_of),
    Column("what", words.what_of, is_words=True),
    Column("why", words.why_of, worth=1, is_words=True),
    Column("done", words.percent_of, worth=2, is_right=True),
    Column("left", words.left_of, worth=4, is_right=True),
    Column("starts in", _starts, worth=5, is_right=True),
    Column("after", lambda s: str(s.after or ""), worth=6, is_right=True),
    Column("from", lambda s: s.submitter, worth=7, is_right=True),
)


def queue_table(queue: QueueStatus, *, width: int, rows: int | None = None) -> Group:
    """Give a queue within ``width`` columns and ``rows`` lines, None: as many as it takes."""
    tasks = ([queue.current] if queue.current is not None else []) + list(queue.waiting)
    count = queue.waiting_count + (queue.current is not None)
    above = [words.headline_of(queue)]
    if queue.counts and (rows is None or rows >= len(above) + LEAST_ROWS):
        above.append(words.counts_of(queue))
    if rows is not None:
        room = max(rows - len(above) - 1, 0)  # below the names of the columns
        tasks = tasks[:room] if count <= room else tasks[: max(room - 1, 0)]
    # in a window that is drawn again each line has its place; elsewhere the way on is not cut off
    parts: list[Text | Table] = [Text(text) if rows is None else _line(text) for text in above]
    if tasks:
        parts.append(task_table(tasks, width=width))
        if count > len(tasks):
            parts.append(_line(f"and {count - len(tasks)} more"))
    return Group(*parts)


def task_table(tasks: Sequence[TaskStatus], *, width: int) -> Table:
    """Give tasks, one a line, with the columns for which there is room."""
    table = Table(box=None, padding=(0, GAP, 0, 0), pad_edge=False, header_style="bold")
    columns = fitting(tasks, width)
    for column, its_width in columns:
        table.add_column(
            column.name,
            width=its_width,
            no_wrap=True,
            overflow="ellipsis",
            justify="right" if column.is_right else "left",
        )
    for status in tasks:
        cells = [Text(column.cell(status)) for column, _ in columns]
        for (column, _), cell in zip(columns, cells, strict=True):
            if column.name == "state":
                cell.stylize(STYLES.get(status.state, ""))
        table.add_row(*cells)
    return table


def fitting(tasks: Sequence[TaskStatus], width: int) -> list[tuple[Column, int]]:
    """Give the columns for which there is room, each with its width; empty ones are left out."""
    wanted = {column: _width(column, tasks) for column in COLUMNS}
    shown: list[Column] = []
    for column in sorted(COLUMNS, key=lambda c: c.worth):
        is_empty = not any(column.cell(task) for task in tasks)
        words_have = LEAST_WORDS if column.is_words else GOOD_WORDS
        least = _least([*shown, column], wanted, words_have)
        if not is_empty and (not column.worth or least <= width):
            shown.append(column)
    spare = max(0, width - _least(shown, wanted, LEAST_WORDS))
    widths: list[tuple[Column, int]] = []
    for column in (each for each in COLUMNS if each in shown):
        least = min(wanted[column], LEAST_WORDS) if column.is_words else wanted[column]
        more = min(spare, wanted[column] - least)
        spare -= more
        widths.append((column, least + more))
    return widths


def vehicle_table(vehicles: Sequence[VehicleStatus]) -> Table:
    """Give rovers, one a line."""
    table = Table(box=None, padding=(0, GAP, 0, 0), pad_edge=False, header_style="bold")
    for name in ("rover", "kind", "mode", "armed", "heard", "north", "east", "heading", "speed"):
        is_number = name in ("rover", "north", "east", "heading", "speed")
        table.add_column(name, justify="right" if is_number else "left")
    for each in vehicles:
        table.add_row(
            str(each.id),
            each.kind,
            each.mode,
            "-" if each.armed is None else "armed" if each.armed else "disarmed",
            _heard(each),
            _number(each.north, "m", 2),
            _number(each.east, "m", 2),
            _number(None if each.yaw is None else degrees(each.yaw) % 360, "deg", 1),
            _number(each.speed, "m/s", 2),
        )
    return table


def _heard(vehicle: VehicleStatus) -> str:
    age = vehicle.heartbeat_age
    if vehicle.is_heard or age is None:
        return "yes" if vehicle.is_heard else "NO"
    return "never" if age == inf else f"{format_duration(age)} ago"


def _width(column: Column, tasks: Sequence[TaskStatus]) -> int:
    return max(cell_len(text) for text in (column.name, *map(column.cell, tasks)))


def _least(columns: Sequence[Column], wanted: dict[Column, int], words_have: int) -> int:
    widths = (min(wanted[c], words_have) if c.is_words else wanted[c] for c in columns)
    return sum(widths) + GAP * max(len(columns) - 1, 0)


def _line(text: str) -> Text:
    return Text(text, no_wrap=True, overflow="ellipsis")


def _number(value: float | None, unit: str, digits: int) -> str:
    return "-" if value is None else f"{value:z.{digits}f} {unit}"
