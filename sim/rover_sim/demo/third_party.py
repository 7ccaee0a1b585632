"""A third party: it submits three tasks by pymavlink's stock messages, follows and measures them.

It submits each task once the previous one is acknowledged.
"""

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from rich.console import Console
from rich.table import Table

from mav_tasks.mavlink.codec import Decoder
from mav_tasks.mavlink.messages import TaskStatus
from mav_tasks.tasks.lifecycle import TaskState
from rover_sim.observing.observer import AUTOPILOT, Answer, Heard, Observer, until
from rover_sim.observing.track import Place

REQUEST_MESSAGE, SET_MESSAGE_INTERVAL, STATUS_INTERVAL = 512, 511, 200_000  # µs
TASK_MOVE, TASK_ROTATE = 54000, 54001
TASK_SERVER = 191
STARTING, EXECUTING, COMPLETED = 4, 5, 9  # from COMPLETED on, a task is over
POSITIONS = 5  # LOCAL_POSITION_NED messages until the rover counts as present
ASK_AGAIN = 0.5  # s
PATIENCE = 85.0  # s, for everything
PIPE_WIDTH = 110  # columns, if the output is no terminal


@dataclass(slots=True)
class Task:
    """One task of the tutorial, and what is known of it."""

    name: str
    command: int
    amount: float
    unit: str
    priority: int
    tolerance: float  # the rover's own estimate is off by 2 to 4 cm
    is_accepted: bool | None = None
    task_id: int = 0
    status: TaskStatus | None = None  # the last one
    began: Place | None = None
    ended: Place | None = None

    @property
    def state(self) -> int:
        """The state of the last status; 0: unknown."""
        return self.status.state if self.status else 0

    @property
    def is_over(self) -> bool:
        """Whether it has ended or was refused."""
        return self.state >= COMPLETED or self.is_accepted is False

    @property
    def measured(self) -> float:
        """Metres driven along the first heading, or degrees turned; NaN if unknown."""
        one, other = self.began, self.ended
        if one is None or other is None:
            return math.nan
        if self.unit == "deg":
            return math.degrees(math.remainder(other.yaw - one.yaw, math.tau))
        north, east = other.north - one.north, other.east - one.east
        return north * math.cos(one.yaw) + east * math.sin(one.yaw)

    @property
    def state_name(self) -> str:
        """The state in words."""
        return TaskState(self.state).name.lower()


def tutorial() -> list[Task]:
    """Return the three tasks, in the order in which they are submitted and should run."""
    return [
        Task("forward", TASK_MOVE, 2.0, "m", priority=3, tolerance=0.05),
        Task("rotate", TASK_ROTATE, 90.0, "deg", priority=8, tolerance=1.0),
        Task("forward", TASK_MOVE, 1.5, "m", priority=5, tolerance=0.05),
    ]


@dataclass
class ThirdParty:
    """Submits the tasks and follows them.

    ``truth`` returns the true pose, ``say`` prints a line, ``check`` raises to end it early.
    """

    observer: Observer
    truth: Callable[[], Place]
    say: Callable[[str], None]
    check: Callable[[], None] = lambda: None
    tasks: list[Task] = field(default_factory=tutorial)
    _positions: int = 0
    _decoder: Decoder = field(default_factory=Decoder)

    async def run(self) -> "ThirdParty":
        """Submit, and wait for the end; give up after PATIENCE."""
        self.observer.listeners.append(self._take)
        end = self.observer.now + PATIENCE
        await until(lambda: self._positions >= POSITIONS, PATIENCE)
        await self._command(SET_MESSAGE_INTERVAL, TaskStatus.id, STATUS_INTERVAL)
        first = self.tasks[0]
        for task in self.tasks:
            await self._submit(task)
            if first.is_accepted:  # it must start at once, so that later ones wait
                await until(lambda: first.state >= STARTING, PATIENCE)
        while not self._is_over() and self.observer.now < end:
            self.check()
            for task in self.tasks:
                if task.state < EXECUTING:
                    await self._command(REQUEST_MESSAGE, TaskStatus.id, task.task_id)
            await until(self._is_over, ASK_AGAIN)
        return self

    def _is_over(self) -> bool:
        return all(task.is_over for task in self.tasks)

    async def _submit(self, task: Task) -> None:
        answer = await self._command(task.command, task.amount, 0, 0, 0, 0, 0, task.priority)
        task.is_accepted, task.task_id = answer.is_accepted, answer.extra
        result, what = str(answer).partition(" ")[0], f"{task.name} {task.amount:g} {task.unit}"
        self.say(f"COMMAND_ACK {result}: {what} at priority {task.priority} is task {answer.extra}")

    async def _command(self, number: int, *params: float) -> Answer:
        return await self.observer.command(number, *params, component=TASK_SERVER)

    def _take(self, heard: Heard) -> None:
        component = heard.packet.source.component_id
        if heard.name == "LOCAL_POSITION_NED":
            self._positions += component == AUTOPILOT
        elif heard.name == "STATUSTEXT" and not heard.message.text.startswith("Task "):
            who = "server" if component == TASK_SERVER else "rover"
            self.say(f"{who} says: {heard.message.text}")
        elif isinstance(status := self._decoder.decode(heard.packet), TaskStatus):
            for task in self.tasks:
                if task.task_id == status.task_id and status.state >= task.state:
                    self._follow(task, status)

    def _follow(self, task: Task, status: TaskStatus) -> None:
        before, task.status = task.status, status
        if before is None or status.text != before.text:
            self.say(f"task {task.task_id}: {status.text}")
        if status.state == EXECUTING and task.began is None:
            task.began = self.truth()
        elif status.state >= COMPLETED and task.ended is None:
            task.ended = self.truth()

    def order(self, task: Task) -> int:
        """Return which one a task was in the order of execution, from 1; 0 if it did not run."""
        began = sorted(each.began.time for each in self.tasks if each.began)
        return 1 + began.index(task.began.time) if task.began else 0

    def conclude(self) -> int:
        """Print a table, and every deviation from the expected result; return how many."""
        table = Table(title="What the rover did")
        for heading in "id", "type", "prio", "order", "state", "time", "asked", "measured", "error":
            table.add_column(heading, justify="left" if heading in ("type", "state") else "right")
        for task in self.tasks:
            took = task.status.execution_time if task.status else math.nan
            digits = (
                3 if task.unit == "m" else 2
            )  # measured and error in the unit of what was asked
            table.add_row(
                *(str(task.task_id), task.name, str(task.priority), str(self.order(task) or "-")),
                *(task.state_name, f"{took:.1f} s", f"{task.amount:g} {task.unit}"),
                *(f"{task.measured:.{digits}f}", f"{task.measured - task.amount:+.{digits}f}"),
            )
        Console(width=None if sys.stdout.isatty() else PIPE_WIDTH).print(table)
        wrong = list(self._problems())
        for problem in wrong:
            self.say(f"WRONG: {problem}")
        return len(wrong)

    def _problems(self) -> Iterator[str]:
        ids = [task.task_id for task in self.tasks]
        if len(set(ids)) != len(ids) or 0 in ids:
            yield f"task ids {ids} are not three different ones"
        for place, task in enumerate(self.tasks, start=1):
            label = f"task {task.task_id} ({task.name})"
            if task.state != COMPLETED:
                yield f"{label} is {task.state_name}, not completed"
            if self.order(task) != place:
                yield f"{label} was number {self.order(task)} to run, not {place}"
            error = abs(task.measured - task.amount)
            if not error <= task.tolerance:
                yield f"{label} is off by {error:.3f} {task.unit}, allowed {task.tolerance}"
