"""Fences as JSON, for the HTTP API: places in degrees, lengths in metres. Pure."""

from collections.abc import Mapping, Sequence
from typing import Any

from mav_tasks.client.goal_form import shortened
from mav_tasks.plan_files import FenceCircle, FencePolygon, PlanFile

DEGREE = 1e7  # of MAVLink's integers


def shapes_of(plan: PlanFile) -> list[dict[str, Any]]:
    """Return the shapes of a fence."""
    return [_shape_of(part) for part in plan.fence]


def circle_of(value: Mapping[str, Any]) -> PlanFile:
    """Return a fence that keeps a rover inside a circle. Raise ValueError if it is invalid."""
    radius = _number(value, "circle", "radius", least=0.1, most=100_000.0)
    circle = FenceCircle(True, _place_of(value, "circle"), radius)
    return PlanFile((), None, (circle,), ())


def polygon_of(value: Sequence[Any]) -> PlanFile:
    """Return a fence that keeps a rover inside a polygon. Raise ValueError if it is invalid."""
    places = tuple(_place_of(place, f"polygon[{at}]") for at, place in enumerate(value))
    return PlanFile((), None, (FencePolygon(True, places),), ())


def _shape_of(part: FenceCircle | FencePolygon) -> dict[str, Any]:
    if isinstance(part, FenceCircle):
        centre = _form_of(part.center)
        return {
            "kind": "circle",
            "inclusion": part.inclusion,
            "centre": centre,
            "radius": part.radius,
        }
    points = [_form_of(place) for place in part.vertices]
    return {"kind": "polygon", "inclusion": part.inclusion, "points": points}


def _form_of(place: tuple[int, int]) -> dict[str, float]:
    return {"latitude": place[0] / DEGREE, "longitude": place[1] / DEGREE}


def _place_of(value: Any, name: str) -> tuple[int, int]:
    latitude = _number(value, name, "latitude", least=-90.0, most=90.0)
    longitude = _number(value, name, "longitude", least=-180.0, most=180.0)
    return round(latitude * DEGREE), round(longitude * DEGREE)


def _number(value: Any, name: str, part: str, *, least: float, most: float) -> float:
    found: Any = value.get(part) if isinstance(value, Mapping) else None
    is_number = isinstance(found, int | float) and not isinstance(found, bool)
    if not is_number or not least <= found <= most:  # false for NaN, and right for any int
        words = f"expected a number from {least:g} to {most:g}"
        raise ValueError(f"{name}.{part} {shortened(found)}: {words}")
    return float(found)
