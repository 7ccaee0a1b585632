"""Parts of documents: the tables of the wire contract and the reference, and the state diagrams.

The short tables stand in the wire contract; the full ones have every command and message.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import product
from typing import Any

from mav_tasks.config.parameter_table import NAMES as PARAMETER_NAMES
from mav_tasks.config.parameter_table import PARAMETERS, Parameter
from mav_tasks.config.settings import ROLES
from mav_tasks.engine.missions.plan_table import REFUSED, SKIPPED, PlanRow, name_of, row_of_item
from mav_tasks.engine.policy import Kind, Row
from mav_tasks.engine.policy import commands as of_commands
from mav_tasks.engine.policy import messages as of_messages
from mav_tasks.engine.policy.commands import ACTS, COMMANDS, UNKNOWN
from mav_tasks.engine.vehicles.control import Event, Grip, Queue, State, Work
from mav_tasks.tasks.lifecycle import INITIAL, TERMINAL, TRANSITIONS, TaskState
from tests.kit.joint.graph import can_happen, variants
from tests.kit.joint.model import MAKES, happens

KINDS = list(Kind)
NAMELESS = replace(UNKNOWN, name="all others")
#: kinds that have a plainer name in the document
NAMES = {Kind.STICKS: "manual", Kind.WISH: "setting", Kind.TELL: "report"}
#: a row of the short policy names so many, else it says what they do
MOST_NAMES = 3
HANDLED = "handled"
USES = ("drives", "sends", "skips", "refuses")
MOST_ITEMS = 8  # in a row of the short table; of more commands it has the numbers
AS_COMMAND = "as the command"
NOTES = {
    Queue.RUNS: "tasks run one after another",
    Queue.PAUSED: "no task starts before a resume",
    Queue.TAKEN: "somebody else controls the rover, set HOLD and resume",
    Queue.STOPPED: "STOP is in force until a resume",
}
#: of events; the others have their names
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


def _table(*lines: str) -> str:
    """Return a table of a head, "a | b | c", and lines like it."""
    head, *rows = (f"| {line} |\n" for line in lines)
    return "".join([head, "|---" * (head.count("|") - 1), "|\n", *rows])


# who may send what


def short_policy() -> str:
    """Return the table of roles and forwarding, with the names of a few, or what they do."""
    listed = [*of_commands.COMMANDS.values(), *of_messages.MESSAGES.values()]
    listed += [*of_commands.BY_WORDS, *of_messages.BY_WORDS, NAMELESS]
    groups = defaultdict[tuple[int, str], dict[str, list[str]]](dict)
    for row in sorted(listed, key=lambda row: KINDS.index(row.kind)):
        way = HANDLED if row.is_claimed else _way(row)
        groups[ROLES.index(row.role), way].setdefault(row.about, []).append(row.name)
    lines = []
    for (role, way), abouts in sorted(groups.items()):
        parts = (
            about if len(names) > MOST_NAMES else ", ".join(names)
            for about, names in abouts.items()
        )
        lines.append(f"{ROLES[role]} | {way} | {'; '.join(parts)}")
    return _table("lowest role | forwarded | commands and messages", *lines)


def full_policy() -> dict[str, list[str]]:
    """Return the lines of the tables of kinds, commands and messages; equal rows share a line."""
    return {
        "kinds": [f"| {_name(kind)} | {kind.value} |" for kind in KINDS],
        "commands": _lines(of_commands.COMMANDS, of_commands.BY_WORDS),
        "messages": _lines(of_messages.MESSAGES, of_messages.BY_WORDS),
    }


def _lines(numbered: Mapping[int, Row], others: Iterable[Row]) -> list[str]:
    groups = defaultdict[Row, list[str]](list)
    named = [(row, f"{number} {row.name}") for number, row in sorted(numbered.items())]
    for row, name in [*named, *((row, row.name) for row in (*others, NAMELESS))]:
        groups[replace(row, name="")].append(name)

    def order(group: tuple[Row, list[str]]) -> tuple[bool, int, int, str]:
        row, names = group
        is_last = NAMELESS.name in names
        return is_last, KINDS.index(row.kind), ROLES.index(row.role), names[0]

    lines = []
    for row, names in sorted(groups.items(), key=order):
        role = f"{row.role}{', bound' * row.is_bound}"
        about = f"{row.about}{'; not counted' * (not row.is_counted)}"
        cells = _name(row.kind), role, about, _way(row), ", ".join(names)
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def _name(kind: Kind) -> str:
    return NAMES.get(kind, kind.name.lower())


def _way(row: Row) -> str:
    """Return whether and when a row is forwarded, in words."""
    if row.is_claimed and row.elsewhere is None:
        return f"{HANDLED}; else as not listed"
    if row.is_claimed:
        on = row.passed_on
        return f"{HANDLED}; else {_name(on.kind)}, {on.role}, {_way(on)}"
    if row.needs_grant:
        return "only in control"
    if not row.passes_beside_task:
        return "not during STOP or a task"
    return "always" if row.passes_under_stop else "not during STOP"


# what becomes of plans


def short_plans() -> str:
    """Return what the server does with items; commands with one effect share a line.

    What it sends has the words of the policy table, and what it refuses is all the rest.
    """
    groups = defaultdict[str, list[int]](list)
    for row, commands in _plan_rows():
        about = f"skipped ({row.about})" if row.use == SKIPPED else row.about
        about = AS_COMMAND if about.startswith(AS_COMMAND) else about
        groups[about] += commands if row.use != REFUSED else []
    lines = [f"{_items(commands)} | {about}" for about, commands in groups.items() if commands]
    others = "all others | refuses the plan; a text says why, and what to do instead"
    return _table("item | what the server does", *lines, others)


def full_plans() -> str:
    """Return the whole table; commands of one row share one line."""
    head = "item | the server | what it does, or why not | ArduPilot Rover 4.6 | PX4 1.17"
    rows = (" | ".join([", ".join(map(name_of, commands)), *row]) for row, commands in _plan_rows())
    return _table(head, *rows)


def _plan_rows() -> list[tuple[PlanRow, list[int]]]:
    groups = defaultdict[PlanRow, list[int]](list)
    for command in sorted(COMMANDS):
        groups[row_of_item(command)].append(command)
    return sorted(groups.items(), key=lambda pair: USES.index(pair[0].use))


def _items(commands: list[int]) -> str:
    if len(commands) <= MOST_ITEMS:
        return ", ".join(map(name_of, commands))
    abouts = {COMMANDS[number].about for number in commands}
    return ACTS.about if abouts == {ACTS.about} else ", ".join(map(str, sorted(commands)))


def parameters() -> str:
    """Return the table of parameters, in the order of the indices."""
    return _table("parameter | range | what it sets", *map(_parameter, PARAMETERS.values()))


def _parameter(parameter: Parameter) -> str:
    key = parameter.key
    about = f"{key.meaning}; at most {PARAMETER_NAMES[key.at_most]}" if key.at_most else key.meaning
    if parameter.choices:
        numbered = (f"{number} {word}" for number, word in enumerate(parameter.choices))
        about += f": {', '.join(numbered)}"
    unit = key.shape.unit.replace("s2", "s²")
    limits = f"{parameter.low:.7g}..{parameter.high:.7g} {unit}".strip()
    return f"{parameter.name} | {limits} | {about}"


# state diagrams


def of_task() -> str:
    """Return the lifecycle table as a Mermaid state diagram; KILLED has one line of its own."""
    edges = [(old, new, why) for old, all_ in TRANSITIONS.items() for new, why in all_.items()]
    killable = ", ".join(old.name.lower() for old, new, _ in edges if new is TaskState.KILLED)
    return _diagram(
        *(f"[*] --> {state.name.lower()}" for state in sorted(INITIAL)),
        *(
            f"{old.name.lower()} --> {new.name.lower()}: {why}"
            for old, new, why in edges
            if new is not TaskState.KILLED
        ),
        *(f"{state.name.lower()} --> [*]" for state in sorted(TERMINAL)),
        after=f"\n`killed` (STOP or kill) is reached from: {killable}.\n",
    )


def of_queue() -> str:
    """Return the states of a queue, from the control table, as a Mermaid state diagram."""
    edges = defaultdict[tuple[Queue, Queue], set[Event]](set)
    for make, queue, grip, work in product(MAKES, Queue, Grip, Work):
        make_of: dict[str, Any] = {**MAKES[make]}
        state = State(queue, grip, work, armed=True, **make_of)
        for event in Event:
            if event not in (Event.CLOSE, Event.LEAVE) and not can_happen(event, state):
                continue
            for each in variants(event, state):
                for there in happens(event, each):
                    edges[queue, there.queue].add(event)
    return _diagram(
        "[*] --> runs",
        *(f"{queue.name.lower()}: {queue.name.lower()}, {note}" for queue, note in NOTES.items()),
        *(
            f"{old.name.lower()} --> {new.name.lower()}: "
            + ", ".join(
                WORDS.get(event, event.name.lower().replace("_", " "))
                for event in Event
                if event in events
            )
            for (old, new), events in edges.items()
            if old is not new
        ),
    )


def _diagram(*lines: str, after: str = "") -> str:
    indented = "".join(f"    {line}\n" for line in lines)
    return f"```mermaid\nstateDiagram-v2\n{indented}```\n{after}"
