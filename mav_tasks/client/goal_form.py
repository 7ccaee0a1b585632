"""Goals as JSON, for the HTTP API and agents: what each kind has, how to read it, its schema. Pure.

Distances are in metres, angles in degrees clockwise, times in seconds:
``{"kind": "goto", "north": 4, "east": -2, "speed": 0.5}``.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import radians
from typing import Any

from mav_tasks.client.fence_form import PLACE
from mav_tasks.client.wire import Goal
from mav_tasks.errors import SettingError
from mav_tasks.setting_keys.parts import Part, read_all, schema_of, shortened
from mav_tasks.setting_keys.shapes import LARGEST, Number
from mav_tasks.tasks.goal import Drive, Face, GlobalPlace, GoTo, LocalPlace, Move, Rotate, Wait

DEGREE = 1e7  # of MAVLink's integers


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of goal: what the rover does, the goal's numbers, and what makes it of them."""

    name: str
    meaning: str
    numbers: tuple[Part, ...]
    make: Callable[..., Goal]

    @property
    def schema(self) -> dict[str, Any]:
        """The JSON schema of a goal of this kind."""
        schema = schema_of(self.numbers)
        return schema | {
            "description": self.meaning,
            "properties": {"kind": {"const": self.name, "type": "string"}, **schema["properties"]},
            "required": ["kind", *schema["required"]],
        }


def _any(unit: str, scale: float = 1.0) -> Number:
    return Number(-LARGEST, LARGEST, unit, scale)


def _positive(unit: str, scale: float = 1.0) -> Number:
    return Number(0, LARGEST, unit, scale)


def _global(latitude: float, longitude: float, **others: Any) -> GoTo:
    return _way(GlobalPlace(round(latitude * DEGREE), round(longitude * DEGREE)), **others)


def _local(north: float, east: float, **others: Any) -> GoTo:
    return _way(LocalPlace(north, east), **others)


def _way(
    place: LocalPlace | GlobalPlace, *, heading: float | None, wait: float | None, **others: Any
) -> GoTo:
    return GoTo(place, yaw=heading, wait=wait or 0.0, **others)


def _face(heading: float, direction: int | None, rate: float | None) -> Face:
    return Face(heading, direction or 0, rate)


def _home(speed: float | None) -> GoTo:
    return GoTo(None, speed)


ANGLE = radians(1)
SPEED = Part("speed", _positive("m/s"), "speed; the server's default if not given")
RATE = Part("rate", _positive("deg/s", ANGLE), "turn rate; the server's default if not given")
HEADING = "heading, clockwise from north"
DURATION = Part("duration", _positive("s"), "how long", True)
ON_ARRIVAL = (
    Part("radius", _positive("m"), "acceptance radius; as close as possible if not given"),
    Part("heading", _any("deg", ANGLE), f"final {HEADING}; any if not given"),
    Part("wait", _positive("s"), "how long to stand there; 0 if not given"),
)

KINDS = (
    Kind(
        "move",
        "Drive straight along the heading that the rover has at the start.",
        (Part("distance", _any("m"), "distance; negative: backwards", True), SPEED),
        Move,
    ),
    Kind(
        "rotate",
        "Turn on the spot by an angle.",
        (Part("angle", _any("deg", ANGLE), "angle; positive: clockwise", True), RATE),
        Rotate,
    ),
    Kind(
        "drive",
        "Drive at a constant velocity for some time.",
        (
            Part("forward", _any("m/s"), "speed; negative: backwards", True),
            Part("yaw_rate", _any("deg/s", ANGLE), "yaw rate; positive: clockwise", True),
            DURATION,
        ),
        Drive,
    ),
    Kind(
        "goto",
        "Drive to a place in the rover's local frame.",
        (
            Part("north", _any("m"), "metres north of the local origin", True),
            Part("east", _any("m"), "metres east of the local origin", True),
            SPEED,
            *ON_ARRIVAL,
        ),
        _local,
    ),
    Kind(
        "goto_global",
        "Drive to a place on earth.",
        (
            *PLACE,
            SPEED,
            *ON_ARRIVAL,
        ),
        _global,
    ),
    Kind(
        "face",
        "Turn on the spot to a heading.",
        (
            Part("heading", _any("deg", ANGLE), HEADING, True),
            Part(
                "direction",
                Number(-1, 1, is_whole=True),
                "1 clockwise, -1 counter-clockwise, 0 or not given: the shorter",
            ),
            RATE,
        ),
        _face,
    ),
    Kind("wait", "Stand still.", (DURATION,), Wait),
    Kind(
        "home",
        "Return to the nearest rally point, else home.",
        (SPEED,),
        lambda speed: GoTo(None, speed),
    ),
)
BY_NAME = {kind.name: kind for kind in KINDS}


def goal_schema() -> dict[str, Any]:
    """Return the JSON schema of a goal of any kind."""
    return {"oneOf": [kind.schema for kind in KINDS]}


def goals_of(forms: Sequence[object]) -> list[Goal]:
    """Return the goals of a request. Raise SettingError that names the part that is invalid."""
    return [_goal_of(form, f"goals[{at}]") for at, form in enumerate(forms)]


def _goal_of(form: object, name: str) -> Goal:
    if not isinstance(form, Mapping):
        raise SettingError(f"{name}: expected an object, such as {{'kind': 'move', 'distance': 2}}")
    kind = BY_NAME.get(form["kind"]) if isinstance(form.get("kind"), str) else None
    if kind is None:
        words = f"expected one of {', '.join(BY_NAME)}"
        raise SettingError(f"{name}.kind {shortened(form.get('kind'))}: {words}")
    numbers = {part: value for part, value in form.items() if part != "kind"}
    return kind.make(**read_all(kind.numbers, numbers, f"{name}."))
