"""The arguments of a tool: each declared once, for its schema and its check. Pure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from mav_tasks.errors import UsageError

KINDS: Mapping[str, tuple[tuple[type, ...], str]] = {
    "integer": ((int,), "a whole number"),
    "number": ((int, float), "a number"),
    "string": ((str,), "a text"),
    "boolean": ((bool,), "true or false"),
    "array": ((list,), "a list"),
}


@dataclass(frozen=True, slots=True)
class Argument:
    """An argument; ``schema`` is its JSON schema, of which ``read`` checks type and bounds."""

    name: str
    schema: Mapping[str, Any]
    is_required: bool = False

    def read(self, value: Any) -> Any:
        """Return the value. Raise UsageError, with the argument's name, if it is invalid."""
        kinds, what = KINDS[self.schema["type"]]
        if kinds == (int,) and isinstance(value, float) and value.is_integer():
            value = int(value)  # JSON has one kind of number
        is_bool_for_number = isinstance(value, bool) and bool not in kinds
        is_infinite = isinstance(value, float) and not isfinite(value)
        if not isinstance(value, kinds) or is_bool_for_number or is_infinite:
            raise UsageError(f"{self.name} {value!r}: expected {what}")
        choices = self.schema.get("enum", (value,))
        if value not in choices:
            raise UsageError(f"{self.name} {value!r}: expected one of {', '.join(choices)}")
        size: Any = len(value) if isinstance(value, str | list) else value
        self._check_bounds(size)
        return value

    def _check_bounds(self, size: float) -> None:
        """Raise UsageError unless a number, or the length of a text or list, is within bounds."""
        for least, most, unit in (
            ("minimum", "maximum", ""),
            ("minLength", "maxLength", " characters"),
            ("minItems", "maxItems", " items"),
        ):
            if size < self.schema.get(least, size):
                raise UsageError(f"{self.name}: expected at least {self.schema[least]:g}{unit}")
            if size > self.schema.get(most, size):
                raise UsageError(f"{self.name}: expected at most {self.schema[most]:g}{unit}")


def schema_of(arguments: Sequence[Argument]) -> dict[str, Any]:
    """Return the JSON schema of a tool's arguments."""
    return {
        "type": "object",
        "properties": {each.name: dict(each.schema) for each in arguments},
        "required": [each.name for each in arguments if each.is_required],
        "additionalProperties": False,
    }


def read(arguments: Sequence[Argument], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the value of each argument, None for one that is not given.

    Raise UsageError that names the argument that is missing, unknown or invalid.
    """
    known = {each.name: each for each in arguments}
    for name in given:
        if name not in known:
            raise UsageError(f"{name}: unknown; expected {', '.join(known) or 'no argument'}")
    values: dict[str, Any] = {}
    for name, argument in known.items():
        value = given.get(name)
        if value is None and argument.is_required:
            raise UsageError(f"{name}: missing; {argument.schema['description']}")
        values[name] = None if value is None else argument.read(value)
    return values
