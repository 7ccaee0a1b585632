"""A third party: pymavlink's stock messages over a link, and no knowledge of mav-tasks' own.

It submits each task once the previous one is acknowledged, and records their states.
"""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass, field

from rover_sim.observing.observer import AUTOPILOT, Answer, Heard, Observer
from rover_sim.observing.track import Place

TASK_MOVE, TASK_ROTATE = 54000, 54001
REQUEST_MESSAGE, SET_MESSAGE_INTERVAL = 512, 511
TASK_STATUS, TASK_STATUS_FORM = 54000, "<5I4f4H10B50sI"
TASK_SERVER = 191
STATES: tuple[str, ...] = (
    "unknown",
    "scheduled",
    "blocked",
    "queued",
    "starting",
    "executing",
    "paused",
)
STATES += ("cancelling", "held", "completed", "failed", "cancelled", "killed", "expired")
STARTING, EXECUTING, FIRST_OVER = 4, 5, 9
POSITIONS = 5  # LOCAL_POSITION_NED messages until the rover counts as present
PROGRESS_INTERVAL_US = 200_000
ASK_AGAIN = 0.5  # s
PATIENCE = 85.0  # s, for everything


@dataclass(frozen=True, slots=True)
class Leg:
    """One task of the tutorial."""

    name: str
    command: int
    amount: float
    unit: str
    priority: int
    tolerance: float  # the rover's own estimate is off by 2 to 4 cm

    def __str__(self) -> str:
        return f"{self.name} {self.amount:g} {self.unit}"


LEGS = (
    Leg("forward", TASK_MOVE, 2.0, "m", 3, 0.05),
    Leg("rotate", TASK_ROTATE, 90.0, "deg", 8, 1.0),
    Leg("forward", TASK_MOVE, 1.5, "m", 5, 0.05),
)


@dataclass(slots=True)
class Seen:
    """The third party's knowledge of one of its tasks."""

    leg: Leg
    is_accepted: bool | None = None
    task_id: int = 0
    state: int = 0
    text: str = ""
    progress: int = 0
    position: int | None = None  # in the queue
    seconds: float = math.nan
    began: Place | None = None
    ended: Place | None = None

    @property
    def measured(self) -> float:
        """Metres driven along the first heading, or degrees turned; NaN if unknown."""
        one, other = self.began, self.ended
        if one is None or other is None:
            return math.nan
        if self.leg.command == TASK_ROTATE:
            return math.degrees(math.remainder(other.yaw - one.yaw, math.tau))
        north, east = other.north - one.north, other.east - one.east
        return north * math.cos(one.yaw) + east * math.sin(one.yaw)


@dataclass
class ThirdParty:
    """Submits LEGS and follows them; ``truth`` returns the true pose, ``say`` prints a line."""

    observer: Observer
    truth: Callable[[], Place]
    say: Callable[[str], None]
    tasks: list[Seen] = field(default_factory=lambda: [Seen(leg) for leg in LEGS])
    order: list[int] = field(default_factory=list)  # of execution, as indices of LEGS
    _positions: int = 0

    async def run(self) -> None:
        """Submit, and wait for the end; give up after PATIENCE."""
        self.observer.listeners.append(self._take)
        end = self.observer.now + PATIENCE
        await self.observer.until(lambda: self._positions >= POSITIONS, PATIENCE)
        await self._command(SET_MESSAGE_INTERVAL, TASK_STATUS, PROGRESS_INTERVAL_US)
        first = self.tasks[0]
        for task in self.tasks:
            await self._submit(task)
            if first.is_accepted:  # it must start at once, so that later ones wait
                await self.observer.until(lambda: first.state >= STARTING, PATIENCE)
        while not self.is_over and self.observer.now < end:
            for task in self.tasks:
                if task.state < EXECUTING:
                    await self._command(REQUEST_MESSAGE, TASK_STATUS, task.task_id)
            await self.observer.until(lambda: self.is_over, ASK_AGAIN)
        if not self.is_over:
            self.say(f"gave up after {PATIENCE:.0f} s")

    @property
    def is_over(self) -> bool:
        """Whether every task has ended or was refused."""
        return all(task.state >= FIRST_OVER or task.is_accepted is False for task in self.tasks)

    async def _submit(self, task: Seen) -> None:
        leg = task.leg
        answer = await self._command(leg.command, leg.amount, 0, 0, 0, 0, 0, leg.priority)
        task.is_accepted, task.task_id = answer.is_accepted, answer.extra
        result = str(answer).partition(" ")[0]
        self.say(f"COMMAND_ACK {result}: {leg} at priority {leg.priority} is task {task.task_id}")

    async def _command(self, number: int, *params: float) -> Answer:
        return await self.observer.command(number, *params, component=TASK_SERVER)

    def _take(self, heard: Heard) -> None:
        component = heard.packet.source.component_id
        if heard.name == "LOCAL_POSITION_NED":
            self._positions += component == AUTOPILOT
        elif heard.name == "STATUSTEXT" and not heard.message.text.startswith("Task "):
            who = "server" if component == TASK_SERVER else "rover"
            self.say(f"{who} says: {heard.message.text}")
        elif heard.packet.message_id == TASK_STATUS:
            self._take_status(heard.packet.payload)

    def _take_status(self, payload: bytes) -> None:
        size = struct.calcsize(TASK_STATUS_FORM)
        fields = struct.unpack(TASK_STATUS_FORM, payload[:size].ljust(size, b"\0"))
        state, text = fields[15], fields[23].split(b"\0")[0].decode("utf-8", "replace")
        for index, task in enumerate(self.tasks):
            if task.task_id != fields[1] or state < task.state:
                continue
            task.seconds, task.progress = fields[8], fields[18]
            task.position = None if fields[10] == 0xFFFF else fields[10]
            if state != task.state and state == EXECUTING:
                task.began = self.truth()
                self.order.append(index)
            elif state != task.state and state >= FIRST_OVER:
                task.ended = self.truth()
            if text != task.text:
                self.say(f"task {task.task_id}: {text}")
            task.state, task.text = state, text


def problems(party: ThirdParty) -> list[str]:
    """Return a description of every deviation from the expected result."""
    found = []
    ids = [task.task_id for task in party.tasks]
    if not all(task.is_accepted for task in party.tasks):
        found.append("a submission was not accepted")
    if len(set(ids)) != len(ids) or 0 in ids:
        found.append(f"task ids {ids} are not three different ones")
    if party.order != [0, 1, 2]:
        found.append(f"order of execution {[ids[i] for i in party.order]}, not {ids}")
    for task in party.tasks:
        label, leg = f"task {task.task_id} ({task.leg.name})", task.leg
        if STATES[task.state] != "completed":
            found.append(f"{label} is {STATES[task.state]}, not completed")
        error = abs(task.measured - leg.amount)
        if not error <= leg.tolerance:
            found.append(f"{label} is off by {error:.3f} {leg.unit}, allowed {leg.tolerance}")
    return found
