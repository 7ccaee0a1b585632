"""Carries out an operation that is declared in ``operations``, with the values of its parts."""

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from mav_tasks.basics.errors import SettingError
from mav_tasks.client.aio import Client
from mav_tasks.client.operations import Operation
from mav_tasks.client.parts import OF_OPERATIONS
from mav_tasks.config.setting_keys.parts import Part


def parts_of(operation: Operation) -> list[Part]:
    """Return the parts of an operation."""
    return [OF_OPERATIONS[name] for name in operation.names]


async def ask(
    client: Client,
    operation: Operation,
    values: Mapping[str, Any],
    *,
    vehicle: int,
    task: int | None = None,
) -> None:
    """Ask it of a rover, or of its task; a value of None is not given."""
    given = {name: value for name, value in values.items() if value is not None}
    if "at" in given:
        given["at"] = moment_of(given["at"])
    given.pop("cron", None)
    if (repeat := repeat_of(values)) is not None:
        given["every"] = repeat
    of = () if operation.about == "rover" else (task,)
    await getattr(client, operation.name)(*of, vehicle=vehicle, **given)


def moment_of(text: str | None) -> datetime | None:
    """Return a time with its zone. Raise SettingError if it is invalid."""
    if text is None:
        return None
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        words = "expected a time such as 2026-11-20T14:30:00Z"
        raise SettingError(f"at {text!r}: {words}") from None
    if moment.tzinfo is None:
        raise SettingError(f"at {text!r}: expected a time zone, such as Z or +01:00")
    return moment


def repeat_of(terms: Mapping[str, Any]) -> int | str | None:
    """Return when a task repeats, None if nothing is said. Raise SettingError if it is twice."""
    if terms.get("every") is not None and terms.get("cron"):
        raise SettingError("every and cron: choose one of them")
    repeat: int | str | None = terms.get("cron") or terms.get("every")
    return repeat
