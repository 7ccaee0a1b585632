"""Draw the states of a rover's queue, from the table of joint control, into mav_tasks/README.md.

`--check` reports whether the drawing is old.
"""

import sys
from itertools import product
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "sim")]

from generated import keep_current  # noqa: E402
from mav_tasks.engine.vehicles.control import Event  # noqa: E402
from mav_tasks.engine.vehicles.joint_state import Grip, Queue, State, Work  # noqa: E402
from tests.kit.joint.graph import can_happen, variants  # noqa: E402
from tests.kit.joint.model import MAKES, happens  # noqa: E402

NAMES = {
    Queue.RUNS: "runs",
    Queue.PAUSED: "paused",
    Queue.TAKEN: "taken",
    Queue.STOPPED: "stopped",
}
NOTES = {
    Queue.RUNS: "tasks take the rover, one after the other",
    Queue.PAUSED: "nothing begins; continue goes on",
    Queue.TAKEN: "somebody else has it; set HOLD, then continue",
    Queue.STOPPED: "it stands, in HOLD; continue goes on",
}
WORDS = {
    Event.STOP: "STOP",
    Event.HOLD: "HOLD",
    Event.MODE: "another mode",
    Event.LAPSED: "HOLD while it is driven",
    Event.DISARM: "disarm",
    Event.STICK: "stick off its centre",
    Event.SECOND: "second controller",
    Event.REBOOTED: "restart of the rover",
    Event.PAUSE_TASKS: "key revoked",
    Event.OPERATOR_LOST: "no ground station",
    Event.EXPLAINED: "its failsafe",
    Event.ASK_OTHER_MODE: "other mode asked for",
    Event.CLOSE: "end of the server",
    Event.TAKEN: "armed to be driven by hand",
    Event.GO_ON: "go-to after HOLD, start of the mission",
    Event.RUN_NOW: "go-to that runs at once",
}


def edges() -> dict[tuple[Queue, Queue], list[Event]]:
    """Return the events that lead from each state of the queue to another."""
    found: dict[tuple[Queue, Queue], list[Event]] = {}
    for make, queue, grip, work in product(MAKES, Queue, Grip, Work):
        make_of: dict[str, Any] = {**MAKES[make]}
        state = State(queue, grip, work, armed=True, **make_of)
        for event in Event:
            if event is not Event.CLOSE and not can_happen(event, state):
                continue
            for each in variants(event, state):
                for there in happens(event, each):
                    events = found.setdefault((queue, there.queue), [])
                    if there.queue is not queue and event not in events:
                        events.append(event)
    return {pair: sorted(events, key=list(Event).index) for pair, events in found.items() if events}


def diagram() -> str:
    """Return the table as a Mermaid state diagram."""
    lines = ["```mermaid", "stateDiagram-v2", "    [*] --> runs"]
    lines += [f"    {NAMES[queue]}: {NAMES[queue]}, {note}" for queue, note in NOTES.items()]
    for (old, new), events in edges().items():
        words = ", ".join(
            WORDS.get(event, event.name.lower().replace("_", " ")) for event in events
        )
        lines.append(f"    {NAMES[old]} --> {NAMES[new]}: {words}")
    return "\n".join([*lines, "```", ""])


if __name__ == "__main__":
    document = "mav_tasks/README.md"
    sys.exit(keep_current(document, "control diagram", "control_diagram.py", diagram()))
