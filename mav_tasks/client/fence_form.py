"""Fences as JSON, for the HTTP API: places in degrees, lengths in metres. Pure."""

from collections.abc import Mapping, Sequence
from typing import Any

from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.shapes import Number
from mav_tasks.kinds.goto import ON_EARTH
from mav_tasks.plans import FenceCircle, FencePolygon, PlanFile

DEGREE = 1e7  # of MAVLink's integers
CIRCLE = (*ON_EARTH, Part("radius", Number(0.1, 100_000.0, "m"), "radius", True))


def shapes_of(plan: PlanFile) -> list[dict[str, Any]]:
    """Return the shapes of a fence."""
    return [_shape_of(part) for part in plan.fence]


def circle_of(value: Mapping[str, Any]) -> PlanFile:
    """Return a fence that keeps a rover inside a circle. Raise SettingError if it is invalid."""
    parts = _read(CIRCLE, value, "circle.")
    circle = FenceCircle(True, _degE7(parts["latitude"], parts["longitude"]), parts["radius"])
    return PlanFile((), None, (circle,), ())


def polygon_of(value: Sequence[Any]) -> PlanFile:
    """Return a fence that keeps a rover inside a polygon. Raise SettingError if it is invalid."""
    places = (_read(ON_EARTH, place, f"polygon[{at}].") for at, place in enumerate(value))
    polygon = FencePolygon(True, tuple(_degE7(**place) for place in places))
    return PlanFile((), None, (polygon,), ())


def _read(parts: Sequence[Part], value: object, within: str) -> dict[str, float]:
    """Return the parts of a place, which may have others, such as its local coordinates."""
    form = value if isinstance(value, Mapping) else {}
    return {part.name: part.read(form, within) for part in parts}


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


def _degE7(latitude: float, longitude: float) -> tuple[int, int]:
    return round(latitude * DEGREE), round(longitude * DEGREE)
