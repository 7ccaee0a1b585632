"""JSON schemas in few words, for the HTTP API and agents. Pure."""

from collections.abc import Collection, Mapping
from typing import Any

Schema = dict[str, Any]

NUMBER: Schema = {"type": "number"}
INTEGER: Schema = {"type": "integer"}
TEXT: Schema = {"type": "string"}
FLAG: Schema = {"type": "boolean"}


def ref(name: str) -> Schema:
    """Return a reference to a schema of the OpenAPI document."""
    return {"$ref": f"#/components/schemas/{name}"}


def or_null(schema: Schema, meaning: str = "") -> Schema:
    """Return the schema of a value that may be unknown."""
    if "type" not in schema:
        return said({"anyOf": [schema, {"type": "null"}]}, meaning)
    found = dict(schema) | {"type": [schema["type"], "null"]}
    if "enum" in schema:
        found["enum"] = [*schema["enum"], None]
    return said(found, meaning)


def said(schema: Schema, meaning: str) -> Schema:
    """Return a schema with its meaning."""
    return schema | ({"description": meaning} if meaning else {})


def listed(schema: Schema) -> Schema:
    """Return the schema of a list."""
    return {"type": "array", "items": schema}


def words(names: Collection[str]) -> Schema:
    """Return the schema of one of several words."""
    return TEXT | {"enum": list(names)}


def whole(parts: Mapping[str, Schema], *, optional: Collection[str] = ()) -> Schema:
    """Return the schema of an object with exactly these parts."""
    required = [name for name in parts if name not in optional]
    return an_object(parts) | {"required": required, "additionalProperties": False}


def an_object(parts: Mapping[str, Schema]) -> Schema:
    """Return the schema of an object with these parts, and perhaps others."""
    return {"type": "object", "properties": dict(parts), "required": list(parts)}
