"""The commands of declared operations that no other module has: ``asked:NAME`` is one."""

from collections.abc import Callable
from inspect import Parameter, Signature
from typing import Any

from mav_tasks.cli import output
from mav_tasks.cli.command import command
from mav_tasks.cli.halts import Everywhere, chosen, each_of
from mav_tasks.cli.options import Common, TaskId
from mav_tasks.cli.parts import parameter_of, value_of
from mav_tasks.cli.session import find_task, opened
from mav_tasks.client.asking import ask, parts_of
from mav_tasks.client.operations import OPERATION, Operation

EMPTY = Parameter.empty


def __getattr__(name: str) -> Callable[..., None]:
    if name not in OPERATION:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _command_of(OPERATION[name])


def _command_of(operation: Operation) -> Callable[..., None]:
    parts = parts_of(operation)

    def read(given: dict[str, Any]) -> dict[str, Any]:
        typed = ((part, given[part.name]) for part in parts)
        return {
            part.name: part.read({part.name: None if text is None else value_of(part, text)}, "--")
            for part, text in typed
        }

    async def of_rover(common: Common, everywhere: bool = False, **given: Any) -> None:
        values = read(given)
        async with opened(common) as client:

            async def one(rover: int) -> str:
                await ask(client, operation, values, vehicle=rover)
                return operation.done

            rovers = chosen(client, common, everywhere=everywhere)
            await each_of(rovers, one, common, operation.name)

    async def of_task(common: Common, task_id: int, **given: Any) -> None:
        values = read(given)
        async with opened(common) as client:
            task = await find_task(client, common, task_id)
            await ask(client, operation, values, vehicle=task.vehicle, task=task_id)
        words = f"rover {task.vehicle}: task {task_id}: {operation.done}"
        output.say_done(common.json, operation.name, words, task=task_id, vehicle=task.vehicle)

    is_of_rover = operation.about == "rover"
    body = of_rover if is_of_rover else of_task
    which = ("everywhere", Everywhere, False) if is_of_rover else ("task_id", TaskId, EMPTY)
    shared = [
        Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=kind)
        for name, kind, default in (which, ("common", Common, EMPTY))
    ]
    vars(body)["__signature__"] = Signature([*map(parameter_of, parts), *shared])
    body.__doc__ = f"{operation.summary}."
    body.__name__ = operation.name
    return command(body)
