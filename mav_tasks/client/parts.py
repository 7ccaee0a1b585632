"""The parts of requests in JSON, for the HTTP API and agents: each declared once. Pure."""

from mav_tasks.client.idempotency import LONGEST
from mav_tasks.client.terms import CHANGES
from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.shapes import Choice, Flag, Items, Number, Text
from mav_tasks.kinds.in_json import goal_schema
from mav_tasks.tasks.task import MAX_TASK_ID

TASK_ID = Number(1, MAX_TASK_ID, is_whole=True)
VEHICLE_ID = Number(1, 255, is_whole=True)
KEY_TEXT = Text(f"1 to {LONGEST} characters", least=1, most=LONGEST)

GOALS = Part("goals", Items(goal_schema(), 1, 200), "what to do, in this order, as one task", True)
HOW = Part(
    "how",
    Choice(("again", "remainder", "skip")),
    "'again' restarts the task from where the rover is, 'remainder' finishes it, 'skip' drops it",
    True,
)
EPOCH = Part(
    "epoch",
    Number(1, (1 << 32) - 1, is_whole=True),
    "halt_epoch that you have read, of the queue or the task: if anything has halted the rover"
    " since then, the request is refused (stale); read again, and think again",
    True,
)

#: of the operations of ``operations``, by their names
OF_OPERATIONS = {
    part.name: part
    for part in (
        *(*CHANGES, HOW, EPOCH),
        Part("kill", Flag(), "put the rover into HOLD at once"),
        Part("series", Flag(), "end its series, too: it does not repeat any more"),
        Part("running_too", Flag(), "also cancel the running task"),
        Part("clear", Flag(), "also cancel the waiting tasks"),
        Part("limit", Number(0, 10_000, is_whole=True), "at most this many tasks"),
    )
}
