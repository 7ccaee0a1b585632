"""What a mission can be made of: a file, what was read from one, or goals."""

from collections.abc import Sequence
from pathlib import Path

from mav_tasks import plan_files
from mav_tasks.client import wire
from mav_tasks.client.wire import Goal
from mav_tasks.plan_files import PlanFile
from mav_tasks.services.mission_item import Item

Plan = PlanFile | Sequence[Goal] | Path | str


def file_of(plan: PlanFile | Path | str) -> PlanFile:
    """Return what a file says. PlanFileError."""
    return plan if isinstance(plan, PlanFile) else plan_files.read_plan(Path(plan))


def items_of(plan: Plan) -> tuple[Item, ...]:
    """Return the items of a mission. PlanFileError, and ValueError where there are none."""
    items = (
        wire.items_of_file(file_of(plan).items)
        if isinstance(plan, PlanFile | Path | str)
        else wire.items_of_goals(plan)
    )
    if not items:
        raise ValueError("the mission has no items")
    return items
