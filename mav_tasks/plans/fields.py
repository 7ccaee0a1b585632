"""Fields of a mission file, checked: each gives a value or a PlanFileError that says where."""

import json
import math
from typing import Any, TypeVar

from mav_tasks.basics.errors import PlanFileError

MAX_FLOAT = 3.4e38  # what a float of MISSION_ITEM_INT holds
NEEDED = {dict: "an object", list: "a list", str: "text", bool: "true or false", float: "a number"}
T = TypeVar("T")


def get(where: str, holder: dict[str, Any], key: str, kind: type[T]) -> T:
    """Return what ``holder`` has under ``key``, of one of the kinds in NEEDED."""
    if key not in holder:
        raise PlanFileError(f"{where}: {key} is missing")
    return typed(where, key, holder[key], kind)


def typed(where: str, name: str, value: object, kind: type[T]) -> T:
    """Return ``value`` if it is of ``kind``, one of NEEDED."""
    if not isinstance(value, kind):
        raise PlanFileError(f"{where}: {name} is {shown(value)}, expected {NEEDED[kind]}")
    return value


def check_version(where: str, holder: dict[str, Any], *known: int | str) -> None:
    """Refuse what is of another version: the same words could mean something else there."""
    kind = str if isinstance(holder.get("version"), str) else float
    version = get(where, holder, "version", kind)
    if version not in known:
        expected = " or ".join(str(each) for each in known)
        raise PlanFileError(
            f"{where}: version {shown(version)} is not supported, expected {expected}:"
            " save it with another version of the program that wrote it"
        )


def number(where: str, name: str, value: object) -> float:
    """Return a number that a float on the wire can hold, or NaN for None: not given."""
    found = math.nan if value is None else typed(where, name, value, float)
    if math.isnan(found):
        return math.nan  # always this one, so that items that hold it can be compared
    if abs(found) > MAX_FLOAT:
        raise PlanFileError(f"{where}: {name} {shown(found)} is too large")
    return found


def whole(where: str, name: str, value: object, most: int) -> int:
    """Return a whole number from 0 to ``most``."""
    found = typed(where, name, value, float)
    if not (0 <= found <= most and found.is_integer()):
        raise PlanFileError(
            f"{where}: {name} is {shown(found)}, expected a whole number from 0 to {most}"
        )
    return int(found)


def refuse_more(what: str, count: int, most: int) -> None:
    """Refuse more than ``most`` of something."""
    if count > most:
        raise PlanFileError(f"more than {most} {what}")


def counted(count: int, what: str) -> str:
    """Return a number of things in words."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def shown(value: object) -> str:
    """A value of JSON in a few words."""
    match value:
        case dict() | list():
            return NEEDED[type(value)]
        case float():
            return repr(value).removesuffix(".0")
        case _:
            return json.dumps(value)[:40]
