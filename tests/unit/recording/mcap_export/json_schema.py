"""Judges the JSON of exported channels by its schema, with jsonschema.

A number may be null, whatever its schema says (dialects/recordings.md).
"""

from collections.abc import Mapping
from typing import Any

import pytest

jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is not installed")


def _is_number(_checker: Any, value: Any) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool))


_Draft: Any = jsonschema.Draft202012Validator
_Validator: Any = jsonschema.validators.extend(
    _Draft, type_checker=_Draft.TYPE_CHECKER.redefine("number", _is_number)
)


def check(value: Any, schema: Mapping[str, Any], path: str = "") -> None:
    """Fail if a value does not fit, or has a field that the schema does not know."""
    _Validator(schema).validate(value)
    assert set(value) <= set(schema["properties"]), path


def check_schema(schema: Mapping[str, Any]) -> None:
    """Fail if a schema is none, or has what viewers cannot read: lists of types, other types."""
    _Validator.check_schema(schema)
    assert schema["type"] == "object"
    assert _types(schema) <= {"object", "array", "string", "number", "integer"}


def _types(schema: Mapping[str, Any]) -> set[str]:
    if "oneOf" in schema:
        return set()
    parts = [*schema.get("properties", {}).values(), *filter(None, [schema.get("items")])]
    return {schema["type"]}.union(*map(_types, parts))
