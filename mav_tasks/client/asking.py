"""Carries out an operation that is declared in ``operations``, with the values of its parts."""

from collections.abc import Mapping
from typing import Any

from mav_tasks.client.aio import Client
from mav_tasks.client.operations import Operation
from mav_tasks.client.parts import OF_OPERATIONS
from mav_tasks.client.terms import CHANGES, requested
from mav_tasks.config.setting_keys.parts import Part


def parts_of(operation: Operation) -> list[Part]:
    """Return the parts of an operation."""
    terms = CHANGES if operation.has_terms else ()
    return [*terms, *(OF_OPERATIONS[name] for name in operation.parts.split())]


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
    if operation.has_terms:
        given = {**requested(given)}
    of = () if operation.about == "rover" else (task,)
    await getattr(client, operation.name)(*of, vehicle=vehicle, **given)
