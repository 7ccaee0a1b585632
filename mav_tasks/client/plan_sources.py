"""The sources of a mission: a file, a parsed file, or goals."""

from collections.abc import Sequence
from pathlib import Path

from mav_tasks import plans as plan_files
from mav_tasks.client import wire
from mav_tasks.client.wire import Goal
from mav_tasks.engine.services.missions import Item
from mav_tasks.plans import PlanFile

Plan = PlanFile | Sequence[Goal] | Path | str


def file_of(plan: PlanFile | Path | str) -> PlanFile:
    """Return the parsed file. Raise PlanFileError if it is invalid."""
    return plan if isinstance(plan, PlanFile) else plan_files.read_plan(Path(plan))


def items_of(plan: Plan) -> tuple[Item, ...]:
    """Return a mission's items. Raise PlanFileError for a bad file, ValueError if it is empty."""
    if not isinstance(plan, PlanFile | Path | str):
        items = wire.items_of_goals(plan)
    elif (file := file_of(plan)).items or not (file.fence or file.rally):
        items = wire.items_of_file(file.items)
    else:
        raise ValueError(
            "there is no mission in it, only a fence or rally points: upload it as these"
        )
    if not items:
        raise ValueError("there is no mission in it: it has no items")
    return items
