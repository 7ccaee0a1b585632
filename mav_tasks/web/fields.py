"""The parts of a request's JSON body: declared once, for reading it and for the OpenAPI document.

Pure.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mav_tasks.client.goal_form import LARGEST, shortened
from mav_tasks.web.problems import invalid

EXPECTED = {
    "number": "a number",
    "integer": "a whole number",
    "string": "a text",
    "boolean": "true or false",
    "array": "a list",
    "object": "an object",
}


@dataclass(frozen=True, slots=True)
class Field:
    """One part. ``least`` and ``most``: of a number, or of a text's or list's length.

    ``items`` is the JSON schema of a list's items.
    """

    name: str
    type: str
    meaning: str
    is_required: bool = False
    least: float | None = None
    most: float | None = None
    choices: Sequence[str] = ()
    items: Mapping[str, Any] | None = None

    @property
    def schema(self) -> dict[str, Any]:
        """The JSON schema of the part."""
        kinds = {"number": "imum", "integer": "imum", "string": "Length", "array": "Items"}
        schema: dict[str, Any] = {"type": [self.type] if self.is_required else [self.type, "null"]}
        if len(schema["type"]) == 1:
            schema["type"] = self.type
        schema["description"] = self.meaning
        for prefix, bound in (("min", self.least), ("max", self.most)):
            if bound is not None:
                schema[prefix + kinds[self.type]] = bound
        if self.choices:
            schema["enum"] = list(self.choices)
        if self.type == "array":
            schema["items"] = dict(self.items or {})
        return schema

    def read(self, body: Mapping[str, Any]) -> Any:
        """Return the part of a body, None if it is not given. Raise Problem if it is invalid."""
        value = body.get(self.name)
        if value is None:
            if self.is_required:
                raise invalid(f"{self.name}: missing; expected {self.meaning}")
            return None
        if not self._is_of_type(value):
            raise invalid(f"{self.name} {shortened(value)}: expected {EXPECTED[self.type]}")
        if isinstance(value, str) and not _is_unicode(value):
            raise invalid(f"{self.name} {shortened(value)}: half of a UTF-16 pair is no character")
        if self.choices and value not in self.choices:
            words = ", ".join(self.choices)
            raise invalid(f"{self.name} {shortened(value)}: expected one of {words}")
        size = len(value) if isinstance(value, str | list) else value
        if self.least is not None and size < self.least:
            raise invalid(
                f"{self.name} {shortened(value)}: expected at least {self.least:g}{self._of}"
            )
        if self.most is not None and size > self.most:
            raise invalid(
                f"{self.name} {shortened(value)}: expected at most {self.most:g}{self._of}"
            )
        return value

    @property
    def _of(self) -> str:
        return {"string": " characters", "array": " parts"}.get(self.type, "")

    def _is_of_type(self, value: object) -> bool:
        match self.type:
            case "number":
                return _is_number(value)
            case "integer":
                return isinstance(value, int) and not isinstance(value, bool)
            case "string":
                return isinstance(value, str)
            case "boolean":
                return isinstance(value, bool)
            case "array":
                return isinstance(value, list)
            case _:
                return isinstance(value, dict)


def body_schema(fields: Sequence[Field]) -> dict[str, Any]:
    """Return the JSON schema of a body."""
    return {
        "type": "object",
        "properties": {field.name: field.schema for field in fields},
        "required": [field.name for field in fields if field.is_required],
        "additionalProperties": False,
    }


def read_body(fields: Sequence[Field], body: object) -> dict[str, Any]:
    """Return each declared part, None if it is not given. Raise Problem if one is invalid."""
    if not isinstance(body, dict):
        raise invalid("the request's body: expected a JSON object")
    known = {field.name for field in fields}
    for name in body:
        if name not in known:
            words = ", ".join(sorted(known)) or "nothing"
            raise invalid(f"{shortened(name)}: no such part; expected {words}")
    return {field.name: field.read(body) for field in fields}


def _is_unicode(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return -LARGEST <= value <= LARGEST  # false for NaN, and right for any int
