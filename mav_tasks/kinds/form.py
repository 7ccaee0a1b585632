"""The form of a kind in JSON: its name, what the rover does, its numbers, and what makes a goal.

Distances are in metres, angles in degrees clockwise, times in seconds.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import radians
from typing import Any

from mav_tasks.config.setting_keys.parts import Part, schema_of
from mav_tasks.config.setting_keys.shapes import LARGEST, Number

DEGREE = radians(1)


@dataclass(frozen=True, slots=True)
class Form:
    """The form of one kind; ``make`` takes the kept values of its numbers by their names."""

    name: str
    title: str  # for a list from which a person chooses
    meaning: str
    numbers: tuple[Part, ...]
    make: Callable[..., Any]

    @property
    def schema(self) -> dict[str, Any]:
        """The JSON schema of a goal of this kind."""
        schema = schema_of(self.numbers)
        return schema | {
            "description": self.meaning,
            "properties": {"kind": {"const": self.name, "type": "string"}, **schema["properties"]},
            "required": ["kind", *schema["required"]],
        }


def any_number(unit: str, scale: float = 1.0) -> Number:
    """Return the shape of a number of either sign."""
    return Number(-LARGEST, LARGEST, unit, scale)


def positive(unit: str, scale: float = 1.0) -> Number:
    """Return the shape of a number from 0 on."""
    return Number(0, LARGEST, unit, scale)


SPEED = Part("speed", positive("m/s"), "speed; the server's default if not given")
RATE = Part("rate", positive("deg/s", DEGREE), "turn rate; the server's default if not given")
HEADING = "heading, clockwise from north"
DURATION = Part("duration", positive("s"), "how long", True)
