"""The report of a probe, as a table."""

from collections.abc import Iterable, Mapping

from rich.table import Table
from rich.text import Text

from mav_tasks.probe.report import Line, Mark

STYLES: Mapping[Mark, str] = {
    Mark.PLAIN: "",
    Mark.GOOD: "green",
    Mark.WARNING: "yellow",
    Mark.BAD: "bold red",
}


def table_of(lines: Iterable[Line]) -> Table:
    """Return the lines as a table; long texts are wrapped."""
    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column()
    for line in lines:
        style = STYLES[line.mark]
        table.add_row(Text(line.topic), Text(line.mark.value, style), Text(line.words, style))
    return table
