"""The running output of the demonstration: lines, and in a terminal a live queue."""

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from rover_sim.demo.third_party import EXECUTING, FIRST_OVER, STATES, Seen, ThirdParty

STEP = 25  # per cent of progress between two lines, without a live table


class Screen:
    """Prints lines; in a terminal it also keeps a table at the bottom up to date."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._live = Live(console=console, auto_refresh=False) if console.is_terminal else None
        self._told: dict[int, int] = {}

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._live is not None:
            self._live.stop()

    def say(self, text: str) -> None:
        """Print one line."""
        self._console.print(text, highlight=False, markup=False)

    def update(self, party: ThirdParty) -> None:
        """Show the state of the tasks."""
        if self._live is not None:
            self._live.update(_table(party.tasks), refresh=True)
            return
        for task in party.tasks:
            step = task.progress // STEP * STEP
            if task.state == EXECUTING and step > self._told.get(task.task_id, 0):
                self._told[task.task_id] = step
                self.say(f"task {task.task_id} {step} %")


def _table(tasks: list[Seen]) -> Table:
    table = Table(title="Queue")
    for heading in ("id", "task", "priority", "state", "progress"):
        table.add_column(heading)
    for task in tasks:
        leg = task.leg
        over = task.state >= FIRST_OVER
        ahead = "" if task.queue_position is None else f", {task.queue_position} ahead"
        table.add_row(
            str(task.task_id or "-"),
            f"{leg.name} {leg.amount:g} {leg.unit}",
            str(leg.priority),
            (STATES[task.state] if task.state else "-") + ("" if over else ahead),
            ProgressBar(total=100, completed=task.progress, width=24),
        )
    return table
