"""Prints the policy table into dialects/README.md; `--check` reports whether it is old."""

import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace

from generated import keep_current
from mav_tasks.engine.policy import Kind, Row
from mav_tasks.engine.policy import commands as of_commands
from mav_tasks.engine.policy import messages as of_messages
from mav_tasks.engine.policy.row import UNKNOWN
from mav_tasks.settings import ROLES

KINDS = list(Kind)
HEAD = "| kind | from | what it is about | what becomes of it | which |\n|---|---|---|---|---|"
NAMELESS = replace(UNKNOWN, name="every other one")

Group = tuple[Row, list[str]]


def table() -> str:
    """Return kinds, commands and messages in words, with equal rows joined in one line."""
    kinds = [f"| {kind.name.lower()} | {kind.value} |" for kind in KINDS]
    commands = _lines(of_commands.COMMANDS.items(), (*of_commands.BY_WORDS, NAMELESS))
    messages = _lines(of_messages.MESSAGES.items(), (*of_messages.BY_WORDS, NAMELESS))
    parts = ["| kind | what it does |\n|---|---|", *kinds]
    parts += ["", "Commands:", "", HEAD, *commands, "", "Messages:", "", HEAD, *messages, ""]
    return "\n".join(parts)


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
    return (NAMELESS.name in names, KINDS.index(row.kind), ROLES.index(row.role), names[0])


def _line(row: Row, names: list[str]) -> str:
    role = f"{row.role}, bound" if row.is_bound else row.role
    about = row.about if row.is_counted else f"{row.about}; not counted"
    cells = (row.kind.name.lower(), role, about, _way(row), ", ".join(names))
    return f"| {' | '.join(cells)} |"


def _way(row: Row) -> str:
    """Return a row's treatment in words."""
    if row.is_claimed and row.elsewhere is None:
        return "the server's; else as what is not named"
    if row.is_claimed:
        on = row.passed_on
        return f"the server's; else {on.kind.name.lower()}, {on.role}, {_way(on)}"
    if row.needs_grant:
        return "passes for who has control"
    if not row.passes_beside_task:
        return "not under STOP, nor beside a task"
    return "passes always" if row.passes_under_stop else "not under STOP"


if __name__ == "__main__":
    sys.exit(keep_current("dialects/README.md", "policy table", "policy_table.py", table()))
