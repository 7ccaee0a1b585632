"""The tables of the documents: who may send what, what becomes of plans, parameters.

The short ones stand in the wire contract; the full ones have every command and message.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import chain

from mav_tasks.config.parameter_table import NAMES as PARAMETER_NAMES
from mav_tasks.config.parameter_table import PARAMETERS, Parameter
from mav_tasks.config.settings import ROLES
from mav_tasks.engine.missions.plan_table import (
    REFUSED,
    SKIPPED,
    PlanRow,
    name_of,
    row_of_item,
)
from mav_tasks.engine.policy import Kind, Row
from mav_tasks.engine.policy import commands as of_commands
from mav_tasks.engine.policy import messages as of_messages
from mav_tasks.engine.policy.commands import ACTS, COMMANDS, UNKNOWN

KINDS = list(Kind)
NAMELESS = replace(UNKNOWN, name="all others")
#: kinds that have a plainer name in the document
NAMES = {Kind.STICKS: "manual", Kind.WISH: "setting", Kind.TELL: "report"}
#: a row of the short policy names so many, else it says what they do
MOST_NAMES = 3
HANDLED = "handled"

Group = tuple[Row, list[str]]

PLAN_HEAD = "| item | the server | what it does, or why not | ArduPilot Rover 4.6 | PX4 1.17 |"
USES = ("drives", "sends", "skips", "refuses")
MOST_ITEMS = 8  # in a row of the short table; of more commands it has the numbers
AS_COMMAND = "as the command"

PARAMETER_HEAD = "| parameter | range | what it sets |\n|---|---|---|\n"


def short_policy() -> str:
    """Return the table of roles and forwarding, with the names of a few, or what they do."""
    groups: dict[tuple[int, str], dict[str, list[str]]] = {}
    for row in sorted([*_policy_rows(), NAMELESS], key=_kind):
        way = HANDLED if row.is_claimed else _way(row)
        abouts = groups.setdefault((ROLES.index(row.role), way), {})
        abouts.setdefault(row.about, []).append(row.name)
    lines = ["| lowest role | forwarded | commands and messages |", "|---|---|---|"]
    for (role, way), abouts in sorted(groups.items()):
        parts = (_short(about, names) for about, names in abouts.items())
        lines.append(f"| {ROLES[role]} | {way} | {'; '.join(parts)} |")
    return "\n".join([*lines, ""])


def full_policy() -> dict[str, list[str]]:
    """Return the lines of the tables of kinds, commands and messages; equal rows share a line."""
    return {
        "kinds": [f"| {_name(kind)} | {kind.value} |" for kind in KINDS],
        "commands": _lines(of_commands.COMMANDS, of_commands.BY_WORDS),
        "messages": _lines(of_messages.MESSAGES, of_messages.BY_WORDS),
    }


def _short(about: str, names: list[str]) -> str:
    return about if len(names) > MOST_NAMES else ", ".join(names)


def _policy_rows() -> list[Row]:
    listed = (of_commands.COMMANDS.values(), of_messages.MESSAGES.values())
    return [*chain(*listed), *of_commands.BY_WORDS, *of_messages.BY_WORDS]


def _kind(row: Row) -> int:
    return KINDS.index(row.kind)


def _lines(numbered: Mapping[int, Row], others: Iterable[Row]) -> list[str]:
    groups: dict[Row, list[str]] = {}
    for number, row in sorted(numbered.items()):
        groups.setdefault(replace(row, name=""), []).append(f"{number} {row.name}")
    for row in (*others, NAMELESS):
        groups.setdefault(replace(row, name=""), []).append(row.name)
    return [_line(row, names) for row, names in sorted(groups.items(), key=_order)]


def _order(group: Group) -> tuple[bool, int, int, str]:
    row, names = group
    return (NAMELESS.name in names, _kind(row), ROLES.index(row.role), names[0])


def _name(kind: Kind) -> str:
    return NAMES.get(kind, kind.name.lower())


def _line(row: Row, names: list[str]) -> str:
    role = f"{row.role}, bound" if row.is_bound else row.role
    about = row.about if row.is_counted else f"{row.about}; not counted"
    cells = (_name(row.kind), role, about, _way(row), ", ".join(names))
    return f"| {' | '.join(cells)} |"


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


def short_plans() -> str:
    """Return what the server does with items; commands with one effect share a line.

    What it sends has the words of the policy table, and what it refuses is all the rest.
    """
    groups: dict[str, list[int]] = {}
    for row, commands in _plan_rows():
        if row.use != REFUSED:
            about = f"skipped ({row.about})" if row.use == SKIPPED else row.about
            about = AS_COMMAND if about.startswith(AS_COMMAND) else about
            groups.setdefault(about, []).extend(commands)
    lines = ["| item | what the server does |", "|---|---|"]
    lines += [f"| {_items(commands)} | {about} |" for about, commands in groups.items()]
    lines.append("| all others | refuses the plan; a text says why, and what to do instead |")
    return "\n".join([*lines, ""])


def full_plans() -> str:
    """Return the whole table; commands of one row share one line."""
    lines = [PLAN_HEAD, "|---|---|---|---|---|"]
    for row, commands in _plan_rows():
        lines.append(f"| {', '.join(map(name_of, commands))} | {' | '.join(row)} |")
    return "\n".join([*lines, ""])


def _plan_rows() -> list[tuple[PlanRow, list[int]]]:
    groups: dict[PlanRow, list[int]] = {}
    for command in sorted(COMMANDS):
        groups.setdefault(row_of_item(command), []).append(command)
    return sorted(groups.items(), key=lambda pair: USES.index(pair[0].use))


def _items(commands: list[int]) -> str:
    if len(commands) <= MOST_ITEMS:
        return ", ".join(map(name_of, commands))
    abouts = {COMMANDS[number].about for number in commands}
    return ACTS.about if abouts == {ACTS.about} else ", ".join(map(str, sorted(commands)))


def parameters() -> str:
    """Return the table of parameters, in the order of the indices."""
    return PARAMETER_HEAD + "".join(map(_parameter, PARAMETERS.values()))


def _parameter(parameter: Parameter) -> str:
    key = parameter.key
    about = f"{key.meaning}; at most {PARAMETER_NAMES[key.at_most]}" if key.at_most else key.meaning
    if parameter.choices:
        numbered = enumerate(parameter.choices)
        about += f": {', '.join(f'{number} {word}' for number, word in numbered)}"
    unit = key.shape.unit.replace("s2", "s²")
    limits = f"{parameter.low:.7g}..{parameter.high:.7g} {unit}".strip()
    return f"| {parameter.name} | {limits} | {about} |\n"
