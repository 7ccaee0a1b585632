"""Read a mission file of either format, told apart by what is in it and not by its name."""

from pathlib import Path

from mav_tasks.errors import PlanFileError
from mav_tasks.plan_files.fields import refuse_more
from mav_tasks.plan_files.qgc_plan import from_json
from mav_tasks.plan_files.qgc_wpl import from_wpl
from mav_tasks.plan_files.values import PlanFile, fence_items

MAX_SIZE = 10_000_000  # bytes or characters; a large survey has some 100,000
MAX_ITEMS = 65_534  # of a kind: MISSION_COUNT.count is a uint16, and home may come on top


def read_plan(path: Path) -> PlanFile:
    """Return what a file says; PlanFileError also where it cannot be opened or is no UTF-8."""
    try:
        with path.open("rb") as file:
            data = file.read(MAX_SIZE + 1)
    except OSError as error:
        raise PlanFileError(f"{path}: {error.strerror}") from error
    try:
        return parse_plan_bytes(data)
    except PlanFileError as error:
        raise PlanFileError(f"{path}: {error}") from error


def parse_plan_bytes(data: bytes) -> PlanFile:
    """Return what the bytes of a file say; PlanFileError, and nothing else, if they are no plan."""
    refuse_more("bytes", len(data), MAX_SIZE)
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        raise PlanFileError("not a plan file: not UTF-8 text") from None
    return parse_plan(text)


def parse_plan(text: str) -> PlanFile:
    """Return what the text of a file says; PlanFileError, and nothing else, if it is no such text.

    A byte order mark may come first; lines may end in any way.
    """
    refuse_more("characters", len(text), MAX_SIZE)
    text = text.removeprefix("\ufeff")
    plan = from_json(text) if text.lstrip().startswith("{") else from_wpl(text)
    refuse_more("mission items", len(plan.items), MAX_ITEMS)
    refuse_more("fence items", len(fence_items(plan)), MAX_ITEMS)
    refuse_more("rally points", len(plan.rally), MAX_ITEMS)
    return plan
