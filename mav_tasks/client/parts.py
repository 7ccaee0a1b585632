"""The parts of requests in JSON, for the HTTP API and agents: each declared once. Pure."""

from mav_tasks.client.idempotency import LONGEST
from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.shapes import Choice, Flag, Items, Number, Text
from mav_tasks.kinds.in_json import goal_schema
from mav_tasks.mavlink.label import MAX_LABEL
from mav_tasks.tasks.repetition import MAX_PERIOD, MAX_REPEAT, MIN_PERIOD
from mav_tasks.tasks.task import DEFAULT_PRIORITY, MAX_PRIORITY, MAX_TASK_ID

WAIT = Number(0, 366 * 24 * 3600, "s")
TASK_ID = Number(1, MAX_TASK_ID, is_whole=True)
TASK_OR_NONE = Number(0, MAX_TASK_ID, is_whole=True)
VEHICLE_ID = Number(1, 255, is_whole=True)
KEY_TEXT = Text(f"1 to {LONGEST} characters", least=1, most=LONGEST)

PRIORITY = Part(
    "priority",
    Number(0, MAX_PRIORITY, is_whole=True),
    f"{MAX_PRIORITY} runs first; {DEFAULT_PRIORITY} if not given",
)
AFTER = Part("after", TASK_ID, "id of a task that must complete first")
DELAY = Part("delay", WAIT, "earliest start, from now")
AT = Part("at", Text("a time", least=1, most=40), "start time, ISO 8601 with a time zone")
DEADLINE = Part("deadline", WAIT, "latest start, from now; then the task expires")
LABEL = Part(
    "label",
    Text("a name", most=MAX_LABEL),
    f"name of the task, at most {MAX_LABEL} bytes of UTF-8",
)
EVERY = Part(
    "every",
    Number(MIN_PERIOD, MAX_PERIOD, "s", is_whole=True),
    "repeat: from one start to the next; a deadline counts from each start",
)
CRON = Part(
    "cron",
    Text("a cron expression", least=1, most=MAX_REPEAT),
    "repeat: minute, hour, day of month, month, day of week, and perhaps a time zone, else UTC",
)
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
        *(PRIORITY, DELAY, AT, DEADLINE, LABEL, CRON, HOW, EPOCH),
        Part("after", TASK_OR_NONE, "task that must complete first; 0: none"),
        Part("before", TASK_OR_NONE, "it runs just before this task; 0: last"),
        Part(
            "every", Number(0, MAX_PERIOD, "s", is_whole=True), "repeat: between starts; 0: do not"
        ),
        Part("preemptible", Flag(), "other tasks may interrupt it"),
        Part("preemptive", Flag(), "it may interrupt other tasks"),
        Part("kill", Flag(), "put the rover into HOLD at once"),
        Part("series", Flag(), "end its series, too: it does not repeat any more"),
        Part("running_too", Flag(), "also cancel the running task"),
        Part("clear", Flag(), "also cancel the waiting tasks"),
    )
}
