"""A third party: stock pymavlink with its `common` dialect, and no code of mav-tasks.

It submits each task once the previous one is acknowledged, and records their states. The caller
owns the link: this file needs only pymavlink's `mav` object and the received messages.
"""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

TASK_MOVE, TASK_ROTATE = 54000, 54001
REQUEST_MESSAGE, SET_MESSAGE_INTERVAL = 512, 511
TASK_STATUS = 54000
ROVER, TASK_SERVER = 1, 191
ACCEPTED = 0
STATES = (
    "unknown",
    "scheduled",
    "blocked",
    "queued",
    "starting",
    "executing",
    "paused",
    "cancelling",
    "held",
    "completed",
    "failed",
    "cancelled",
    "killed",
    "expired",
)
STARTING, EXECUTING, FIRST_OVER = 4, 5, 9
POSITIONS = 5  # LOCAL_POSITION_NED messages until the rover counts as present
PROGRESS_INTERVAL_US = 200_000
QUEUE_INTERVAL = 0.5  # s
HEARTBEAT_INTERVAL = 1.0  # s


@dataclass(frozen=True, slots=True)
class Leg:
    """One task of the tutorial."""

    name: str
    command: int
    amount: float  # m or degrees
    priority: int

    @property
    def unit(self) -> str:
        """The unit of the amount."""
        return "m" if self.command == TASK_MOVE else "deg"


LEGS = (
    Leg("forward", TASK_MOVE, 2.0, 3),
    Leg("rotate", TASK_ROTATE, 90.0, 8),
    Leg("forward", TASK_MOVE, 1.5, 5),
)
ORDER = (0, 1, 2)  # of execution, as indices of LEGS


@dataclass(frozen=True, slots=True)
class Place:
    """True pose of the rover: metres and radians."""

    north: float
    east: float
    yaw: float


@dataclass(slots=True)
class Seen:
    """The third party's knowledge of one of its tasks."""

    leg: Leg
    result: int | None = None
    task_id: int = 0
    state: int = 0
    text: str = ""
    progress: int = 0
    queue_position: int | None = None
    execution_time: float = math.nan
    began: Place | None = None
    ended: Place | None = None


@dataclass
class ThirdParty:
    """Submits LEGS and tracks them; ``truth`` returns the true pose, ``say`` prints a line."""

    mav: Any
    truth: Callable[[], Place]
    say: Callable[[str], None]
    tasks: list[Seen] = field(default_factory=lambda: [Seen(leg) for leg in LEGS])
    order: list[int] = field(default_factory=list)
    _positions: int = 0
    _submitted: int = 0
    _next_heartbeat: float = 0.0
    _next_look: float = 0.0

    @property
    def is_over(self) -> bool:
        """Whether every task has ended or was refused."""
        return all(
            task.state >= FIRST_OVER or task.result not in (None, ACCEPTED) for task in self.tasks
        )

    def step(self, now: float) -> None:
        """Send the messages that are due."""
        if now >= self._next_heartbeat:
            self._next_heartbeat = now + HEARTBEAT_INTERVAL
            self.mav.heartbeat_send(6, 8, 0, 0, 4)
        if self._positions >= POSITIONS:
            self._submit_next()
        if self._submitted == len(LEGS) and now >= self._next_look:
            self._next_look = now + QUEUE_INTERVAL
            for task in self.tasks:
                if task.task_id and task.state < EXECUTING:
                    self._command(REQUEST_MESSAGE, TASK_STATUS, task.task_id)

    def take(self, message: Any) -> None:
        """Process one message."""
        match message.get_type():
            case "LOCAL_POSITION_NED":
                self._positions += 1
            case "COMMAND_ACK" if message.command in (TASK_MOVE, TASK_ROTATE):
                self._take_ack(message)
            case "STATUSTEXT" if not message.text.startswith("Task "):  # TASK_STATUS has it
                who = "server" if message.get_srcComponent() == TASK_SERVER else "rover"
                self.say(f"{who} says: {message.text}")
            case "UNKNOWN_54000":
                self._take_status(message)

    def _submit_next(self) -> None:
        if self._submitted == len(LEGS):
            return
        if self._submitted and self.tasks[self._submitted - 1].result is None:
            return  # one at a time, so that each ack belongs to a known task
        if self._submitted and self.tasks[0].state < STARTING:
            return  # the first one must start at once, so that later ones wait
        if self._submitted == 0:
            self._command(SET_MESSAGE_INTERVAL, TASK_STATUS, PROGRESS_INTERVAL_US)
        leg = LEGS[self._submitted]
        self._submitted += 1
        self._command(leg.command, leg.amount, 0, 0, 0, 0, 0, leg.priority)

    def _take_ack(self, ack: Any) -> None:
        task = next((task for task in self.tasks if task.result is None), None)
        if task is None or task.leg.command != ack.command:
            self.say(f"unexpected COMMAND_ACK: {ack}")
            return
        task.result, task.task_id = ack.result, ack.result_param2
        leg = task.leg
        answer = "ACCEPTED" if ack.result == ACCEPTED else f"refused with result {ack.result}"
        self.say(
            f"COMMAND_ACK {answer}: {leg.name} {leg.amount:g} {leg.unit} at priority "
            f"{leg.priority} is task {ack.result_param2}"
        )

    def _take_status(self, message: Any) -> None:
        packet = bytes(message.get_msgbuf())  # a signature may follow the payload
        payload = packet[10 : 10 + packet[1]].ljust(108, b"\0")[:108]
        fields = struct.unpack("<5I4f4H10B50sI", payload)
        task_id, execution_time, position = fields[1], fields[8], fields[10]
        state, progress = fields[15], fields[18]
        text = fields[23].split(b"\0")[0].decode("utf-8", "replace")
        for index, task in enumerate(self.tasks):
            if task.task_id == task_id and state >= task.state:
                task.progress = progress
                task.execution_time = execution_time
                task.queue_position = None if position == 0xFFFF else position
                if state != task.state:
                    task.state = state
                    self._enter(index, task)
                if text != task.text:
                    task.text = text
                    self.say(f"task {task.task_id}: {text}")

    def _enter(self, index: int, task: Seen) -> None:
        if task.state == EXECUTING:
            task.began = self.truth()
            self.order.append(index)
        elif task.state >= FIRST_OVER:
            task.ended = self.truth()

    def _command(self, command: int, *params: float) -> None:
        filled = (*params, *(0.0,) * (7 - len(params)))
        self.mav.command_long_send(ROVER, TASK_SERVER, command, 0, *filled)
