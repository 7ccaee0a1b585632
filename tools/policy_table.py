"""Write the policy table into the wire contract, and who may do what into the guide.

`--check` reports whether one of them is outdated. ``full_table`` lists every command and message.
"""

import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain

from generated import keep_current
from mav_tasks.config.settings import ROLES
from mav_tasks.engine.policy import Kind, Row
from mav_tasks.engine.policy import commands as of_commands
from mav_tasks.engine.policy import messages as of_messages
from mav_tasks.engine.policy.commands import UNKNOWN

#: the documents of ``short_table`` and ``rights``
CONTRACT, GUIDE = "dialects/rights.md", "mav_tasks/GUIDE.md"

KINDS = list(Kind)
QUIET = (Kind.QUESTION, Kind.TELL)  # they change nothing
HEAD = "| kind | lowest role | purpose | forwarded | commands or messages |\n|---|---|---|---|---|"
NAMELESS = replace(UNKNOWN, name="all others")
#: kinds that have a plainer name in the document
NAMES = {Kind.STICKS: "manual", Kind.WISH: "setting", Kind.TELL: "report"}
#: a row of the short table names so many, else it says what they do
MOST_NAMES = 3
HANDLED = "handled"

LEGEND = """\
- *handled*: by the server at `(N, 191)`, and at `(N, 1)` if it claims it there (`rules.claim`). The
  rule after *else* applies at other components of the vehicle, and with `claim` off.
- *in control*: the client has requested GUIDED or OFFBOARD since the last halt, the vehicle is
  armed, and every task that has started is over.
- *during a task*: while the server takes control, drives, or hands the vehicle back.
- *bound*: can change more than motion.
- *not counted*: does not count towards the rate limit of requests.
"""

#: the limits that hold for the commands and messages of a row, by what the row is about
TASK = "`tasks`, `max_priority`, `max_speed`, `max_distance`, `quota`"
LIMITS = {
    "creates a task": TASK,
    "uploads a mission": TASK,
    "starts one's own plan": TASK,
    "starts a return or the mission, which the server drives": TASK,
    "changes one's own task": "`max_priority`",
    "sets the speed of tasks": "`max_speed`",
}
#: what depends on the content of a task and on its owner (``engine/clients/rights.py``)
BY_CONTENT = {
    "operator": {
        "does all that with everybody's tasks": "as for one's own",
        "makes a task pre-emptive, or runs it immediately": TASK,
        "sends a plan that has commands to the rover": TASK,
        "starts a plan in a paused queue, or of a rover in a manual mode": TASK,
    },
    "safety": {
        "sends a plan that switches the rover's fence, or auxiliary functions (207, 218)": TASK
    },
}

Group = tuple[Row, list[str]]


def short_table() -> str:
    """Return the table of roles and forwarding, with the names of a few, or what they do."""
    groups: dict[tuple[int, str], dict[str, list[str]]] = {}
    for row in sorted([*_rows(), NAMELESS], key=_kind):
        way = HANDLED if row.is_claimed else _way(row)
        abouts = groups.setdefault((ROLES.index(row.role), way), {})
        abouts.setdefault(row.about, []).append(row.name)
    lines = ["| lowest role | forwarded | commands and messages |", "|---|---|---|"]
    for (role, way), abouts in sorted(groups.items()):
        parts = (_short(about, names) for about, names in abouts.items())
        lines.append(f"| {ROLES[role]} | {way} | {'; '.join(parts)} |")
    return "\n".join([*lines, ""])


def full_table() -> str:
    """Return the tables of kinds, commands and messages, and a legend; equal rows share a line."""
    kinds = [f"| {_name(kind)} | {kind.value} |" for kind in KINDS]
    commands = _lines(of_commands.COMMANDS.items(), (*of_commands.BY_WORDS, NAMELESS))
    messages = _lines(of_messages.MESSAGES.items(), (*of_messages.BY_WORDS, NAMELESS))
    parts = ["| kind | a message of this kind |\n|---|---|", *kinds]
    parts += [
        "",
        LEGEND,
        "Commands:",
        "",
        HEAD,
        *commands,
        "",
        "Messages:",
        "",
        HEAD,
        *messages,
        "",
    ]
    return "\n".join(parts)


def rights() -> str:
    """Return the table of who may do what, with the limits that hold for it.

    What has no limits is grouped by kind, the rest by its limits.
    """
    lines = ["| lowest role | what | limits |", "|---|---|---|"]
    for role in ROLES:
        shown = [row for row in _rows() if row.role == role and row.kind not in QUIET]
        groups: dict[tuple[str, str], dict[str, None]] = {}
        for row in sorted(shown, key=_kind):
            limits = LIMITS.get(row.about, "")
            kind = Kind.MOTION if row.kind is Kind.STICKS else row.kind
            groups.setdefault((limits, "" if limits else kind.name), {})[row.about] = None
        for about, limits in BY_CONTENT.get(role, {}).items():
            groups.setdefault((limits, ""), {})[about] = None
        for (limits, _), abouts in groups.items():
            lines.append(f"| `{role}` | {' · '.join(abouts)} | {limits} |")
    return "\n".join([*lines, ""])


def _short(about: str, names: list[str]) -> str:
    return about if len(names) > MOST_NAMES else ", ".join(names)


def _rows() -> list[Row]:
    listed = (of_commands.COMMANDS.values(), of_messages.MESSAGES.values())
    return [*chain(*listed), *of_commands.BY_WORDS, *of_messages.BY_WORDS]


def _kind(row: Row) -> int:
    return KINDS.index(row.kind)


def _lines(numbered: Iterable[tuple[int, Row]], others: Iterable[Row]) -> Iterator[str]:
    groups: dict[Row, list[str]] = {}
    for number, row in sorted(numbered, key=lambda pair: pair[0]):
        groups.setdefault(replace(row, name=""), []).append(f"{number} {row.name}")
    for row in others:
        groups.setdefault(replace(row, name=""), []).append(row.name)
    for row, names in sorted(groups.items(), key=_order):
        yield _line(row, names)


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


if __name__ == "__main__":
    wire = keep_current(CONTRACT, "policy table", "policy_table.py", short_table())
    guide = keep_current(GUIDE, "table of rights", "policy_table.py", rights())
    sys.exit(wire or guide)
