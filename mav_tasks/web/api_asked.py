"""The operations that are made from their declarations (``client.operations``).

Two have more here. A halt is asked for on each connection until one has an answer, and the PATCH of
a task answers with the task.
"""

from typing import Any

from mav_tasks.client import operations as declared
from mav_tasks.client.aio import Client
from mav_tasks.client.asking import ask, parts_of
from mav_tasks.web.flights import Flights
from mav_tasks.web.operation import Call, Handler, Operation
from mav_tasks.web.services import Services
from mav_tasks.web.users import Line

CHANGE = "modify"
PLACES = {"rover": "/vehicles/{vehicle}", "task": "/tasks/{task}"}


def operations(services: Services) -> list[Operation]:
    """Return the operations."""
    client, live = services.client, services.live

    def of_rover(operation: declared.Operation) -> Handler:
        async def run(call: Call, by: Client) -> None:
            await ask(by, operation, call.body, vehicle=services.rover_of(call))
            await live.refresh(call.vehicle)

        return services.asks(run)

    def of_task(operation: declared.Operation) -> Handler:
        async def run(call: Call, by: Client) -> Any:
            status = await services.status_of(call)
            await ask(by, operation, call.body, vehicle=status.vehicle, task=status.id)
            live.hurry(status.vehicle)
            if operation.name == CHANGE:
                return live.task_form(await client.status(status.id, vehicle=status.vehicle))
            return None

        return services.asks(run)

    def halt(operation: declared.Operation) -> Handler:
        halts = Flights()

        async def run(call: Call) -> None:
            rover = services.rover_of(call)

            async def send(line: Line) -> None:
                key = rover, line.name
                await halts.join(key, lambda: ask(line.client, operation, {}, vehicle=rover))

            await services.halted(call, send)
            await live.refresh(rover)

        return run

    def made(operation: declared.Operation) -> Operation:
        place = PLACES[operation.about]
        is_change = operation.name == CHANGE
        make = of_rover if operation.about == "rover" else of_task
        return Operation(
            "PATCH" if is_change else "POST",
            place if is_change else f"{place}/{operation.name}",
            operation.summary,
            halt(operation) if operation.is_halt else make(operation),
            body=parts_of(operation),
            answer="Task" if is_change else "",
        )

    return [made(each) for each in declared.OPERATIONS if each.about in PLACES]
