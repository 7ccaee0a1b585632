"""Tables of queues, finished tasks and rovers, fitted to a width."""

from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from math import degrees, inf
from typing import Generic, NamedTuple, TypeVar

from rich.cells import cell_len
from rich.console import Group
from rich.table import Table
from rich.text import Text

from mav_tasks.cli import words
from mav_tasks.cli.times import format_duration, moment_ago
from mav_tasks.client.descriptions import end_of, state_of, waits_of, what_of, why_of
from mav_tasks.client.values import QueueStatus, TaskStatus, VehicleStatus
from mav_tasks.mavlink.address import who_is
from mav_tasks.tasks.lifecycle import TaskState

GAP = 2  # blanks between two columns
LEAST_ROWS = 4  # rows below the first headline; with fewer there is no second one
LEAST_WORDS = 10  # terminal columns that a text column gets at least, if it needs them
GOOD_WORDS = 24  # those it gets before a number column is added
STYLES = {
    TaskState.EXECUTING: "green",
    TaskState.STARTING: "green",
    TaskState.PAUSED: "yellow",
    TaskState.CANCELLING: "yellow",
    TaskState.HELD: "red",
    TaskState.FAILED: "red",
    TaskState.EXPIRED: "red",
}


T = TypeVar("T")


class Column(NamedTuple, Generic[T]):
    """A column of a table. ``worth`` 0: always shown; the highest is dropped first."""

    name: str
    cell: Callable[[T], str]
    worth: int = 0
    is_words: bool = False  # a text, which may be cut short
    is_right: bool = False


class Row(NamedTuple):
    """A task of a queue, and why it waits."""

    status: TaskStatus
    why: str


TASK_COLUMNS: tuple[Column[Row], ...] = (
    Column("id", lambda row: str(row.status.id), is_right=True),
    Column("prio", lambda row: str(row.status.priority), worth=2, is_right=True),
    Column("state", lambda row: state_of(row.status)),
    Column("label", lambda row: row.status.label, worth=1, is_words=True),
    Column("goal", lambda row: what_of(row.status), is_words=True),
    Column("reason", lambda row: row.why, worth=1, is_words=True),
    Column("starts in", lambda row: words.starts_of(row.status), worth=3, is_right=True),
    Column("repeats", lambda row: words.every_of(row.status), worth=3, is_words=True),
    Column("ends in", lambda row: words.ends_of(row.status), worth=4, is_right=True),
    Column("done", lambda row: words.percent_of(row.status), worth=5, is_right=True),
    Column("left", lambda row: words.left_of(row.status), worth=6, is_right=True),
    Column("by", lambda row: who_is(row.status.submitter), worth=7),
)


def queue_table(
    queue: QueueStatus, *, width: int, rows: int | None = None, is_alone: bool = True
) -> Group:
    """Return a queue within ``width`` columns and ``rows`` lines; None: no limit.

    ``is_alone``: the server has one rover, which commands need not name.
    """
    tasks = ([queue.current] if queue.current is not None else []) + list(queue.waiting)
    count = queue.waiting_count + (queue.current is not None)
    above = [words.headline_of(queue, is_alone=is_alone)]
    if queue.counts and (rows is None or rows >= len(above) + LEAST_ROWS):
        above.append(words.counts_of(queue))
    if rows is not None:
        room = max(rows - len(above) - 1, 0)  # below the column names
        tasks = tasks[:room] if count <= room else tasks[: max(room - 1, 0)]
    # a redrawn window cuts its lines; elsewhere they wrap, which keeps the command at the end
    parts: list[Text | Table] = [Text(text) if rows is None else _line(text) for text in above]
    if tasks:
        waits = waits_of(queue)
        shown = [Row(each, waits.get(each.id, why_of(each))) for each in tasks]
        styles = {"state": lambda row: STYLES.get(row.status.state, "")}
        parts.append(_table(TASK_COLUMNS, shown, width, styles=styles))
        if count > len(tasks):
            parts.append(_line(f"and {count - len(tasks)} more"))
    return Group(*parts)


def history_table(tasks: Sequence[TaskStatus], *, now: datetime, width: int) -> Table:
    """Return finished tasks, one per line, with the columns that fit.

    Times are shown in the time zone of ``now``.
    """

    def ended(status: TaskStatus) -> str:
        return "" if status.ended_ago is None else moment_ago(status.ended_ago, now=now)

    columns: tuple[Column[TaskStatus], ...] = (
        Column("id", lambda status: str(status.id), is_right=True),
        Column("state", state_of),
        Column("label", lambda status: status.label, worth=1, is_words=True),
        Column("goal", what_of, is_words=True),
        Column("reason", end_of, worth=1, is_words=True),
        Column(f"ended ({now:%Z})", ended, worth=2, is_right=True),
        Column("run time", words.took_of, worth=3, is_right=True),
        Column("done", words.percent_of, worth=4, is_right=True),
        Column("by", lambda status: who_is(status.submitter), worth=5),
    )
    return _table(columns, tasks, width, styles={"state": lambda s: STYLES.get(s.state, "")})


def vehicle_table(vehicles: Sequence[VehicleStatus], *, width: int) -> Table:
    """Return rovers, one per line, with the columns that fit."""
    return _table(VEHICLE_COLUMNS, vehicles, width, styles={})


def _table(
    columns: Sequence[Column[T]],
    rows: Sequence[T],
    width: int,
    *,
    styles: Mapping[str, Callable[[T], str]],
) -> Table:
    table = Table(box=None, padding=(0, GAP, 0, 0), pad_edge=False, header_style="bold")
    shown = fitting(columns, rows, width)
    for column, its_width in shown:
        table.add_column(
            column.name,
            width=its_width,
            no_wrap=True,
            overflow="ellipsis",
            justify="right" if column.is_right else "left",
        )
    for row in rows:
        cells = [Text(column.cell(row)) for column, _ in shown]
        for (column, _), cell in zip(shown, cells, strict=True):
            if column.name in styles:
                cell.stylize(styles[column.name](row))
        table.add_row(*cells)
    return table


def fitting(
    columns: Sequence[Column[T]], rows: Sequence[T], width: int
) -> list[tuple[Column[T], int]]:
    """Return the columns that fit, each with its width, without empty columns."""
    wanted = {column.name: _width(column, rows) for column in columns}
    shown: list[Column[T]] = []
    for column in sorted(columns, key=lambda c: c.worth):
        is_empty = not any(column.cell(row) for row in rows)
        words_have = LEAST_WORDS if column.is_words else GOOD_WORDS
        least = _least([*shown, column], wanted, words_have)
        if not is_empty and (not column.worth or least <= width):
            shown.append(column)
    spare = max(0, width - _least(shown, wanted, LEAST_WORDS))
    widths: list[tuple[Column[T], int]] = []
    for column in (each for each in columns if each in shown):
        most = wanted[column.name]
        least = min(most, LEAST_WORDS) if column.is_words else most
        more = min(spare, most - least)
        spare -= more
        widths.append((column, least + more))
    return widths


def _heard(vehicle: VehicleStatus) -> str:
    age = vehicle.heartbeat_age
    if vehicle.is_heard or age is None:
        return "yes" if vehicle.is_heard else "no"
    return "never" if age == inf else f"{format_duration(age)} ago"


def _heading(vehicle: VehicleStatus) -> str:
    if vehicle.yaw is None:
        return "-"
    return f"{round(degrees(vehicle.yaw), 1) % 360:.1f} deg"  # never 360.0


VEHICLE_COLUMNS: tuple[Column[VehicleStatus], ...] = (
    Column("rover", lambda v: str(v.id), is_right=True),
    Column("kind", lambda v: v.kind, worth=5),
    Column("mode", lambda v: v.mode, worth=2),
    Column("armed", lambda v: "-" if v.armed is None else "armed" if v.armed else "disarmed"),
    Column("heard", _heard, worth=1),
    Column("north", lambda v: _number(v.north, "m", 2), worth=4, is_right=True),
    Column("east", lambda v: _number(v.east, "m", 2), worth=4, is_right=True),
    Column("heading", _heading, worth=6, is_right=True),
    Column("speed", lambda v: _number(v.speed, "m/s", 2), worth=3, is_right=True),
)


def _width(column: Column[T], rows: Sequence[T]) -> int:
    return max(cell_len(text) for text in (column.name, *map(column.cell, rows)))


def _least(columns: Sequence[Column[T]], wanted: Mapping[str, int], words_have: int) -> int:
    widths = (min(wanted[c.name], words_have) if c.is_words else wanted[c.name] for c in columns)
    return sum(widths) + GAP * max(len(columns) - 1, 0)


def _line(text: str) -> Text:
    return Text(text, no_wrap=True, overflow="ellipsis")


def _number(value: float | None, unit: str, digits: int) -> str:
    return "-" if value is None else f"{value:z.{digits}f} {unit}"
