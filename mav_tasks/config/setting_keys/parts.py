"""The parts of a JSON object: each declared once, for reading, checking and describing it. Pure.

The HTTP API, agents' tools and goals are declared so.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mav_tasks.basics.errors import SettingError
from mav_tasks.config.setting_keys.shapes import Choice, Flag, Items, Name, Number, Record, Text


@dataclass(frozen=True, slots=True)
class Part:
    """One part; ``meaning`` is for people, without the unit, which the shape has."""

    name: str
    shape: Number | Choice | Name | Flag | Text | Items | Record
    meaning: str
    is_required: bool = False

    @property
    def about(self) -> str:
        """The meaning, with the unit."""
        return f"{self.meaning} ({self.shape.unit})" if self.shape.unit else self.meaning

    @property
    def schema(self) -> dict[str, Any]:
        """The JSON schema of the part."""
        return self.shape.schema() | {"description": self.about}

    def read(self, form: Mapping[str, Any], within: str = "") -> Any:
        """Return the kept value of the part of an object, None if it is not given.

        Raise SettingError that names the part, ``within`` the object so named, if it is invalid.
        """
        value, where = form.get(self.name), f"{within}{self.name}"
        if value is None:
            if self.is_required:
                raise SettingError(f"{where}: missing; expected {self.about}")
            return None
        try:
            if isinstance(value, str):
                value.encode()
            return self.shape.kept(value)
        except UnicodeEncodeError:
            words = "half of a UTF-16 pair is no character"
        except SettingError as error:
            words = str(error)
        raise SettingError(f"{where} {shortened(value)}: {words}")


def schema_of(parts: Sequence[Part]) -> dict[str, Any]:
    """Return the JSON schema of an object with these parts, and no others."""
    return {
        "type": "object",
        "properties": {part.name: part.schema for part in parts},
        "required": [part.name for part in parts if part.is_required],
        "additionalProperties": False,
    }


def read_all(parts: Sequence[Part], form: object, within: str = "") -> dict[str, Any]:
    """Return the kept value of each part of a JSON object, None for one that is not given.

    Raise SettingError that names the first part that is missing, unknown or invalid.
    """
    if not isinstance(form, Mapping):
        raise SettingError(f"{within[:-1] or 'the request'}: expected a JSON object")
    known = [part.name for part in parts]
    for name in form:
        if name not in known:
            words = f"unknown; expected {', '.join(known) or 'nothing'}"
            raise SettingError(f"{within}{shortened(name)[1:-1]}: {words}")
    return {part.name: part.read(form, within) for part in parts}


def shortened(value: object) -> str:
    """Return a wrong value for a message: printable, at most 60 characters."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
