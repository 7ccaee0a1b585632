"""Goals as JSON, for the HTTP API and agents: what each kind has, how to read it, its schema. Pure.

Distances are in metres, angles in degrees clockwise, times in seconds:
``{"kind": "goto", "north": 4, "east": -2, "speed": 0.5}``.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from typing import Any

from mav_tasks.client.wire import Goal
from mav_tasks.tasks.goal import Drive, Face, GlobalPlace, GoTo, LocalPlace, Move, Rotate, Wait

DEGREE = 1e7  # of MAVLink's integers
LARGEST = 3.4e38  # what a float32 of MAVLink holds


@dataclass(frozen=True, slots=True)
class Number:
    """A number of a goal; ``unit`` in words for people; ``least`` and ``most``: None: any."""

    name: str
    unit: str
    meaning: str
    is_required: bool = False
    least: float | None = None
    most: float | None = None

    @property
    def schema(self) -> dict[str, Any]:
        """The JSON schema of the number."""
        bounds = {"minimum": self.least, "maximum": self.most}
        return {
            "type": "number",
            "description": f"{self.meaning} ({self.unit})",
            **{name: bound for name, bound in bounds.items() if bound is not None},
        }


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of goal: what the rover does, and the goal's numbers."""

    name: str
    meaning: str
    numbers: tuple[Number, ...]

    @property
    def schema(self) -> dict[str, Any]:
        """The JSON schema of a goal of this kind."""
        return {
            "type": "object",
            "description": self.meaning,
            "properties": {
                "kind": {"const": self.name, "type": "string"},
                **{number.name: number.schema for number in self.numbers},
            },
            "required": ["kind", *(each.name for each in self.numbers if each.is_required)],
            "additionalProperties": False,
        }


SPEED = Number("speed", "m/s", "speed; the server's default if not given", least=0.0)
RATE = Number("rate", "deg/s", "turn rate; the server's default if not given", least=0.0)
HEADING = "heading, clockwise from north"
ON_ARRIVAL = (
    Number("radius", "m", "acceptance radius; as close as possible if not given", least=0.0),
    Number("heading", "deg", f"final {HEADING}; any if not given"),
    Number("wait", "s", "how long to stand there; 0 if not given", least=0.0),
)

KINDS = (
    Kind(
        "move",
        "Drive straight along the heading that the rover has at the start.",
        (Number("distance", "m", "distance; negative: backwards", True), SPEED),
    ),
    Kind(
        "rotate",
        "Turn on the spot by an angle.",
        (Number("angle", "deg", "angle; positive: clockwise", True), RATE),
    ),
    Kind(
        "drive",
        "Drive at a constant velocity for some time.",
        (
            Number("forward", "m/s", "speed; negative: backwards", True),
            Number("yaw_rate", "deg/s", "yaw rate; positive: clockwise", True),
            Number("duration", "s", "how long", True, 0.0),
        ),
    ),
    Kind(
        "goto",
        "Drive to a place in the rover's local frame.",
        (
            Number("north", "m", "metres north of the local origin", True),
            Number("east", "m", "metres east of the local origin", True),
            SPEED,
            *ON_ARRIVAL,
        ),
    ),
    Kind(
        "goto_global",
        "Drive to a place on earth.",
        (
            Number("latitude", "deg", "latitude, WGS 84", True, -90.0, 90.0),
            Number("longitude", "deg", "longitude, WGS 84", True, -180.0, 180.0),
            SPEED,
            *ON_ARRIVAL,
        ),
    ),
    Kind(
        "face",
        "Turn on the spot to a heading.",
        (
            Number("heading", "deg", HEADING, True),
            Number(
                "direction",
                "",
                "1 clockwise, -1 counter-clockwise, 0 or not given: the shorter",
                False,
                -1,
                1,
            ),
            RATE,
        ),
    ),
    Kind("wait", "Stand still.", (Number("duration", "s", "how long", True, 0.0),)),
    Kind("home", "Return to the nearest rally point, else home.", (SPEED,)),
)
BY_NAME = {kind.name: kind for kind in KINDS}


def goal_schema() -> dict[str, Any]:
    """Return the JSON schema of a goal of any kind."""
    return {"oneOf": [kind.schema for kind in KINDS]}


def goal_of(form: object, name: str = "goal") -> Goal:
    """Return the goal of a JSON object. Raise ValueError, with the part's name, if it is invalid.

    ``name`` is the object's name in the request.
    """
    if not isinstance(form, Mapping):
        raise ValueError(f"{name}: expected an object, such as {{'kind': 'move', 'distance': 2}}")
    kind = BY_NAME.get(form["kind"]) if isinstance(form.get("kind"), str) else None
    if kind is None:
        words = f"expected one of {', '.join(BY_NAME)}"
        raise ValueError(f"{name}.kind {shortened(form.get('kind'))}: {words}")
    known = {number.name for number in kind.numbers} | {"kind"}
    for each in form:
        if each not in known:
            words = f"a goal '{kind.name}' has no such part"
            raise ValueError(f"{name}.{shortened(each)[1:-1]}: {words}")
    return _made(kind.name, {each.name: _read(each, form, name) for each in kind.numbers})


def shortened(value: object) -> str:
    """Return a wrong value for a message: printable, at most 60 characters."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _read(number: Number, form: Mapping[str, Any], name: str) -> float | None:
    value = form.get(number.name)
    where = f"{name}.{number.name}"
    if value is None:
        if number.is_required:
            raise ValueError(f"{where}: missing; expected {number.meaning} ({number.unit})")
        return None
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not -LARGEST <= value <= LARGEST:  # false for NaN, and right for any int
        raise ValueError(f"{where} {shortened(value)}: expected a number ({number.unit})")
    if number.least is not None and value < number.least:
        raise ValueError(f"{where} {value:g}: expected at least {number.least:g} {number.unit}")
    if number.most is not None and value > number.most:
        raise ValueError(f"{where} {value:g}: expected at most {number.most:g} {number.unit}")
    return float(value)


def _made(kind: str, numbers: Mapping[str, Any]) -> Goal:
    match kind:
        case "move":
            return Move(numbers["distance"], numbers["speed"])
        case "rotate":
            return Rotate(radians(numbers["angle"]), _radians(numbers["rate"]))
        case "drive":
            yaw_rate = radians(numbers["yaw_rate"])
            return Drive(numbers["forward"], yaw_rate, numbers["duration"])
        case "goto":
            return _way(LocalPlace(numbers["north"], numbers["east"]), numbers)
        case "goto_global":
            latitude, longitude = numbers["latitude"], numbers["longitude"]
            place = GlobalPlace(round(latitude * DEGREE), round(longitude * DEGREE))
            return _way(place, numbers)
        case "face":
            direction = int(numbers["direction"] or 0)
            return Face(radians(numbers["heading"]), direction, _radians(numbers["rate"]))
        case "wait":
            return Wait(numbers["duration"])
        case _:
            return GoTo(None, speed=numbers["speed"])


def _way(place: LocalPlace | GlobalPlace, numbers: Mapping[str, Any]) -> GoTo:
    return GoTo(
        place,
        speed=numbers["speed"],
        radius=numbers["radius"],
        yaw=_radians(numbers["heading"]),
        wait=numbers["wait"] or 0.0,
    )


def _radians(angle: float | None) -> float | None:
    return None if angle is None else radians(angle)
