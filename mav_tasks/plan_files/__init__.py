"""Mission files to values: QGroundControl's .plan and "QGC WPL 110". Nothing is sent from here."""

from mav_tasks.plan_files.reader import parse_plan, read_plan
from mav_tasks.plan_files.values import (
    FenceCircle,
    FencePolygon,
    GeoPoint,
    PlanFile,
    PlanItem,
    fence_items,
    rally_items,
)

__all__ = [
    "FenceCircle",
    "FencePolygon",
    "GeoPoint",
    "PlanFile",
    "PlanItem",
    "fence_items",
    "parse_plan",
    "rally_items",
    "read_plan",
]
