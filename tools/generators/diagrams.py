"""The state diagrams of mav_tasks/README.md: of a task, and of a rover's queue."""

from itertools import product
from typing import Any

from mav_tasks.engine.vehicles.control import Event, Grip, Queue, State, Work
from mav_tasks.tasks.lifecycle import INITIAL, TERMINAL, TRANSITIONS, TaskState
from tests.kit.joint.graph import can_happen, variants
from tests.kit.joint.model import MAKES, happens

NOTES = {
    Queue.RUNS: "tasks run one after another",
    Queue.PAUSED: "no task starts before a resume",
    Queue.TAKEN: "somebody else controls the rover, set HOLD and resume",
    Queue.STOPPED: "STOP is in force until a resume",
}
WORDS = {
    Event.STOP: "STOP",
    Event.HOLD: "HOLD",
    Event.MODE: "another mode",
    Event.LAPSED: "HOLD while a task drives",
    Event.LAPSED_WITH_LEASE: "failsafe while the lease is lost",
    Event.LATE_MODE: "late mode request",
    Event.LATE_ARMING: "late arming request",
    Event.DISARM: "disarm request",
    Event.DISARMED: "seen disarmed",
    Event.STICK: "stick off centre",
    Event.DRIVEN_BY_HAND: "manual control by a client",
    Event.SECOND: "second controller",
    Event.REBOOTED: "rover restarted",
    Event.PAUSE_TASKS: "key revoked",
    Event.OPERATOR_LOST: "no ground station",
    Event.EXPLAINED: "failsafe of the rover",
    Event.ASK_OTHER_MODE: "client requests another mode",
    Event.CLOSE: "server shuts down",
    Event.TAKEN: "armed for manual control",
    Event.CONTINUE: "resume",
    Event.GO_ON: "go-to right after HOLD, mission start",
    Event.RUN_NOW: "immediate go-to",
}


def of_task() -> str:
    """Return the lifecycle table as a Mermaid state diagram; KILLED has one line of its own."""
    lines = ["```mermaid", "stateDiagram-v2"]
    lines += [f"    [*] --> {_name(state)}" for state in sorted(INITIAL)]
    for old, edges in TRANSITIONS.items():
        lines += [
            f"    {_name(old)} --> {_name(new)}: {why}"
            for new, why in edges.items()
            if new is not TaskState.KILLED
        ]
    killable = ", ".join(
        _name(old) for old, edges in TRANSITIONS.items() if TaskState.KILLED in edges
    )
    lines += [f"    {_name(state)} --> [*]" for state in sorted(TERMINAL)]
    lines += ["```", "", f"`killed` (STOP or kill) is reached from: {killable}.", ""]
    return "\n".join(lines)


def _name(state: TaskState | Queue) -> str:
    return state.name.lower()


def _edges() -> dict[tuple[Queue, Queue], list[Event]]:
    """Return the events that lead from each state of the queue to another."""
    found: dict[tuple[Queue, Queue], list[Event]] = {}
    for make, queue, grip, work in product(MAKES, Queue, Grip, Work):
        make_of: dict[str, Any] = {**MAKES[make]}
        state = State(queue, grip, work, armed=True, **make_of)
        for event in Event:
            if event not in (Event.CLOSE, Event.LEAVE) and not can_happen(event, state):
                continue
            for each in variants(event, state):
                for there in happens(event, each):
                    events = found.setdefault((queue, there.queue), [])
                    if there.queue is not queue and event not in events:
                        events.append(event)
    return {pair: sorted(events, key=list(Event).index) for pair, events in found.items() if events}


def of_queue() -> str:
    """Return the states of a queue, from the control table, as a Mermaid state diagram."""
    lines = ["```mermaid", "stateDiagram-v2", "    [*] --> runs"]
    lines += [f"    {_name(queue)}: {_name(queue)}, {note}" for queue, note in NOTES.items()]
    for (old, new), events in _edges().items():
        words = ", ".join(
            WORDS.get(event, event.name.lower().replace("_", " ")) for event in events
        )
        lines.append(f"    {_name(old)} --> {_name(new)}: {words}")
    return "\n".join([*lines, "```", ""])
