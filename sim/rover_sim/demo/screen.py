"""The output of the demonstration: lines, in a terminal a live queue, and the table at the end."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from rover_sim.demo.third_party import EXECUTING, FIRST_OVER, STATES, Seen, ThirdParty

STEP = 25  # per cent of progress between two lines, without a live table
PIPE_WIDTH = 110  # columns, if the output is no terminal


class Screen:
    """Prints lines; in a terminal it also keeps a table at the bottom up to date."""

    def __init__(self) -> None:
        self._console = Console()
        self._live: Live | None = None
        if not self._console.is_terminal:
            self._console = Console(width=PIPE_WIDTH)
        self._told: dict[int, int] = {}

    @contextmanager
    def live(self) -> Iterator[None]:
        """Show the queue below the lines for a ``with`` block, in a terminal."""
        if not self._console.is_terminal:
            yield
            return
        with Live(console=self._console, auto_refresh=False) as self._live:
            yield
        self._live = None

    def say(self, text: str) -> None:
        """Print one line."""
        self._console.print(text, soft_wrap=True, highlight=False, markup=False)

    def update(self, party: ThirdParty) -> None:
        """Show the state of the tasks."""
        if self._live is not None:
            self._live.update(_queue(party.tasks), refresh=True)
            return
        for task in party.tasks:
            step = task.progress // STEP * STEP
            if task.state == EXECUTING and step > self._told.get(task.task_id, 0):
                self._told[task.task_id] = step
                self.say(f"task {task.task_id} {step} %")

    def conclude(self, party: ThirdParty) -> None:
        """Print one line for each task; measured and error have the unit of what was asked."""
        table = Table(title="What the rover did")
        for heading in ("id", "type", "prio", "order", "state", "time"):
            table.add_column(heading, justify="left" if heading in ("type", "state") else "right")
        for heading in ("asked", "measured", "error"):
            table.add_column(heading, justify="right")
        for index, task in enumerate(party.tasks):
            leg, digits = task.leg, 3 if task.leg.unit == "m" else 2
            table.add_row(
                *(str(task.task_id), leg.name, str(leg.priority)),
                str(party.order.index(index) + 1) if index in party.order else "-",
                *(STATES[task.state], f"{task.seconds:.1f} s", f"{leg.amount:g} {leg.unit}"),
                f"{task.measured:.{digits}f}",
                f"{task.measured - leg.amount:+.{digits}f}",
            )
        self._console.print(table)


def _queue(tasks: list[Seen]) -> Table:
    table = Table("id", "task", "priority", "state", "progress", title="Queue")
    for task in tasks:
        is_ahead = task.position is not None and task.state < FIRST_OVER
        table.add_row(
            str(task.task_id or "-"),
            str(task.leg),
            str(task.leg.priority),
            STATES[task.state] + (f", {task.position} ahead" if is_ahead else ""),
            ProgressBar(total=100, completed=task.progress, width=24),
        )
    return table
