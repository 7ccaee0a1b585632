"""The table of dialects/README.md of what becomes of each command in a plan."""

from mav_tasks.engine.missions.plan_table import PlanRow, name_of, row_of_item
from mav_tasks.engine.policy.commands import COMMANDS

HEAD = "| item | the server | what it does, or why not | ArduPilot Rover 4.6 | PX4 1.17 |"
USES = ("drives", "sends", "skips", "refuses")


def table() -> str:
    """Return the table; commands of one row share one line."""
    groups: dict[PlanRow, list[int]] = {}
    for command in sorted(COMMANDS):
        groups.setdefault(row_of_item(command), []).append(command)
    lines = [HEAD, "|---|---|---|---|---|"]
    for row, commands in sorted(groups.items(), key=lambda pair: USES.index(pair[0].use)):
        lines.append(f"| {', '.join(map(name_of, commands))} | {' | '.join(row)} |")
    return "\n".join([*lines, ""])
