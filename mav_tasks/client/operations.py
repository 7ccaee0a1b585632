"""What can be asked of rovers and tasks: each operation declared once.

From it come the routes of the HTTP API and their description, the tools of agents, the names and
help of commands, and a command for one that has none by hand. What an operation does is the
client's method of the same name, which has its parts as keywords. Imports nothing that takes time:
the help of the command line reads this.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Operation(NamedTuple):
    """``about``: what it is asked of, "rover", "task" or "all".

    ``parts``: names in ``parts.OF_OPERATIONS``, and all terms of a task (``terms``) if it
    ``has_terms``. Those that are required there are needed over HTTP
    and in tools, whose callers do not see what they let go; people need not name them. A tool has
    no others: each word costs an agent.
    ``advice``: what an agent must know besides. ``no_tool``: why agents do not have it.
    ``done``: what an answer says of a rover. ``is_halt``: it stops a rover and lets nothing go.
    ``by_hand``: the surfaces that have more than what is made from this, and what.
    """

    name: str
    about: str
    summary: str
    parts: str = ""
    advice: str = ""
    no_tool: str = ""
    done: str = "done"
    is_halt: bool = False
    has_terms: bool = False
    by_hand: Mapping[str, str] = MappingProxyType({})


OPERATIONS = (
    Operation(
        "cancel",
        "task",
        "Cancel a task",
        "kill series",
        "If it is being driven, the rover stops; the next task then starts.",
        by_hand={"command": "takes the running task if none is named"},
    ),
    Operation(
        "clear",
        "rover",
        "Cancel all waiting tasks of a rover",
        "running_too",
        no_tool="an agent cancels its tasks one by one",
        by_hand={"command": "asks before it cancels what has begun"},
    ),
    Operation(
        "stop",
        "all",
        "Stop the rovers at once; no task runs until you resume",
        "clear",
        "Stops every rover, or the named one. If in doubt, call it: it needs no permission. The "
        "running task ends; resume needs the role 'operator'.",
        is_halt=True,
        by_hand={
            "command": "does not wait for the server to be found",
            "http": "goes on every connection there is, and is shown until the rovers stand",
            "tool": "does not wait for the server to be found",
        },
    ),
    Operation(
        "pause",
        "rover",
        "Stop a rover, and pause its task and queue until you resume",
        done="paused; its task continues on resume",
        is_halt=True,
        by_hand={
            "command": "says how to resume",
            "http": "goes on every connection until one has an answer",
        },
    ),
    Operation(
        "resume",
        "rover",
        "Resume tasks after a pause, a STOP or a takeover",
        "epoch",
        "Needs the role 'operator'. If a person has stopped the rover, ask that person first.",
        done="resumed",
        by_hand={"command": "says which series a STOP has ended, and what still blocks the rover"},
    ),
    Operation(
        "modify",
        "task",
        "Change a task that has not ended",
        has_terms=True,
        no_tool="an agent cancels its task and submits another one",
        by_hand={
            "command": "reads times and periods as people write them",
            "http": "is the PATCH of the task, and answers with it",
        },
    ),
    Operation(
        "release",
        "task",
        "Restart, finish or skip a held task",
        "how epoch",
        "A held task blocks its rover. Find out first why it is held. If the queue is paused, call "
        "resume, too.",
        by_hand={"command": "takes the held task if none is named"},
    ),
)
#: those that only show something: each surface shows it in its own way, so the words are shared,
#: but for what is returned
READING = (
    Operation(
        "vehicles",
        "all",
        "Show the rovers of the server",
        advice="Position, heading, mode, whether each is armed and heard. Read this first. A rover "
        "that is not heard cannot be driven now.",
    ),
    Operation(
        "queue",
        "rover",
        "Show the running and the waiting tasks, and why they wait",
        "limit",
        "Also whether the queue is paused, and the halt_epoch that resume and release need. "
        "'advice' says what to do now.",
    ),
    Operation(
        "history",
        "rover",
        "List finished tasks, newest first",
        "limit",
        "How each ended, why and when.",
    ),
    Operation(
        "status",
        "task",
        "Show a task, and what to do if it waits for you",
        advice="Its state, progress, why it waits, and in 'advice' what to do now.",
        by_hand={"tool": "is named task"},
    ),
)
OPERATION = {each.name: each for each in (*OPERATIONS, *READING)}
