"""Read a mission, fence or rally file; what is in it says which format it has, not its name."""

from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from pathlib import Path

from mav_tasks.basics.errors import PlanFileError
from mav_tasks.plans.fields import refuse_more
from mav_tasks.plans.qgc_plan import from_json
from mav_tasks.plans.qgc_wpl import from_text
from mav_tasks.plans.values import PlanFile, fence_items

MAX_SIZE = 10_000_000  # bytes or characters; a large survey has some 100,000
MAX_ITEMS = 65_534  # of a kind: MISSION_COUNT.count is a uint16, and home may come on top


def read_plan(path: Path) -> PlanFile:
    """Return what a file says; PlanFileError also where it cannot be opened."""
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
    """Return what the bytes of a file say; PlanFileError, and nothing else, if they are no plan.

    Windows' editors also write UTF-16, and older ones their own 8-bit code: comments may be in it.
    """
    refuse_more("bytes", len(data), MAX_SIZE)
    encoding = "utf-16" if data[:2] in (BOM_UTF16_LE, BOM_UTF16_BE) else "utf-8"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return parse_plan(text)


def parse_plan(text: str) -> PlanFile:
    """Return what the text of a file says; PlanFileError, and nothing else, if it is no such text.

    A byte order mark may come first; lines may end in any way.
    """
    refuse_more("characters", len(text), MAX_SIZE)
    text = text.removeprefix("\ufeff").rstrip("\0\x1a")  # DOS ended texts so
    plan = from_json(text) if text.lstrip().startswith("{") else from_text(text)
    refuse_more("mission items", len(plan.items), MAX_ITEMS)
    refuse_more("fence items", len(fence_items(plan)), MAX_ITEMS)
    refuse_more("rally points", len(plan.rally), MAX_ITEMS)
    return plan
