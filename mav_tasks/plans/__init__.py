"""Mission files and their values: QGroundControl's .plan and "QGC WPL 110". Nothing is sent.

What reads and writes files is loaded when it is first used: a script that has none need not wait.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from mav_tasks.plans.values import (
    FenceCircle,
    FencePolygon,
    GeoPoint,
    PlanFile,
    PlanItem,
    fence_items,
    rally_items,
)

if TYPE_CHECKING:
    from mav_tasks.plans.fetched import fence_of, mission_of
    from mav_tasks.plans.reader import parse_plan, read_plan
    from mav_tasks.plans.writer import format_for, format_plan, format_wpl, write_plan

_HOME_OF = {
    **dict.fromkeys(("fence_of", "mission_of"), "fetched"),
    **dict.fromkeys(("parse_plan", "read_plan"), "reader"),
    **dict.fromkeys(("format_for", "format_plan", "format_wpl", "write_plan"), "writer"),
}

__all__ = [
    "FenceCircle",
    "FencePolygon",
    "GeoPoint",
    "PlanFile",
    "PlanItem",
    "fence_items",
    "fence_of",
    "format_for",
    "format_plan",
    "format_wpl",
    "mission_of",
    "parse_plan",
    "rally_items",
    "read_plan",
    "write_plan",
]


def __getattr__(name: str) -> Any:
    home = _HOME_OF.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{home}"), name)
