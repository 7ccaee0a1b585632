"""Write what becomes of each command in a plan into the wire contract.

`--check` reports whether it is outdated. ``full_table`` lists every command.
"""

import sys

from generated import keep_current
from mav_tasks.engine.missions.plan_table import (
    REFUSED,
    SKIPPED,
    PlanRow,
    name_of,
    row_of_item,
)
from mav_tasks.engine.policy.commands import ACTS, COMMANDS

CONTRACT = "dialects/plans.md"  # the document of ``short_table``
HEAD = "| item | the server | what it does, or why not | ArduPilot Rover 4.6 | PX4 1.17 |"
USES = ("drives", "sends", "skips", "refuses")
MOST_NAMES = 8  # in a row of the short table; of more commands it has the numbers
AS_COMMAND = "as the command"


def short_table() -> str:
    """Return what the server does with items; commands with one effect share a line.

    What it sends has the words of the policy table, and what it refuses is all the rest.
    """
    groups: dict[str, list[int]] = {}
    for row, commands in _rows():
        if row.use != REFUSED:
            about = f"skipped ({row.about})" if row.use == SKIPPED else row.about
            about = AS_COMMAND if about.startswith(AS_COMMAND) else about
            groups.setdefault(about, []).extend(commands)
    lines = ["| item | what the server does |", "|---|---|"]
    lines += [f"| {_items(commands)} | {about} |" for about, commands in groups.items()]
    lines.append("| all others | refuses the plan; a text says why, and what to do instead |")
    return "\n".join([*lines, ""])


def full_table() -> str:
    """Return the whole table; commands of one row share one line."""
    lines = [HEAD, "|---|---|---|---|---|"]
    for row, commands in _rows():
        lines.append(f"| {', '.join(map(name_of, commands))} | {' | '.join(row)} |")
    return "\n".join([*lines, ""])


def _rows() -> list[tuple[PlanRow, list[int]]]:
    groups: dict[PlanRow, list[int]] = {}
    for command in sorted(COMMANDS):
        groups.setdefault(row_of_item(command), []).append(command)
    return sorted(groups.items(), key=lambda pair: USES.index(pair[0].use))


def _items(commands: list[int]) -> str:
    if len(commands) <= MOST_NAMES:
        return ", ".join(map(name_of, commands))
    abouts = {COMMANDS[number].about for number in commands}
    return ACTS.about if abouts == {ACTS.about} else ", ".join(map(str, sorted(commands)))


if __name__ == "__main__":
    sys.exit(keep_current(CONTRACT, "table of plans", "plan_table.py", short_table()))
