"""The task server as agents use it: one connection for the life of the process.

The server may be down at the start or later. Each call looks for it, and raises NoAnswer if it does
not answer.
"""

from mav_tasks.basics.errors import UsageError
from mav_tasks.client.aio import Client
from mav_tasks.client.handle import Task
from mav_tasks.client.telemetry import all_show
from mav_tasks.client.values import TaskStatus, VehicleStatus


class Rovers:
    """The rovers that agents may use: those of a client, or only the client's default rover.

    ``signer`` is the fingerprint of the client's key, "" for none.
    """

    def __init__(self, client: Client, *, only: int | None, signer: str = "") -> None:
        self._client = client
        self._only = only
        self.signer = signer

    async def client(self) -> Client:
        """Return the client once it has found the server. Raise NoAnswer if it finds none."""
        await self._client.found()
        return self._client

    @property
    def unfound(self) -> Client:
        """The client, for a STOP, which must not wait until the server is found."""
        return self._client

    def named(self, vehicle: int | None) -> int | None:
        """Return the named rover, None if none is named. Raise UsageError if it is not offered."""
        if self._only is not None and vehicle not in (None, self._only):
            raise UsageError(f"vehicle {vehicle}: only rover {self._only} is offered here")
        return self._only if vehicle is None else vehicle

    async def vehicle(self, vehicle: int | None) -> int:
        """Return the named rover, or else the only one. Raise NoSuchVehicle if there is none."""
        client = await self.client()
        named = self.named(vehicle)
        return client.vehicle if named is None else named

    async def all(self) -> list[VehicleStatus]:
        """Return the rovers that are offered."""
        client = await self.client()
        await all_show(client, lambda each: each.north is not None and each.yaw is not None)
        return [each for each in client.vehicles() if self._only in (None, each.id)]

    async def task(self, task_id: int) -> Task:
        """Return a task of an offered rover. Raise Refused if there is no such task."""
        status = await self.status(task_id)
        return await self._client.task(task_id, vehicle=status.vehicle)

    async def status(self, task_id: int) -> TaskStatus:
        """Return the status of a task. The server of one rover knows the tasks of all."""
        rovers = (await self.client()).vehicles()
        anyone = self._only if self._only is not None or not rovers else rovers[0].id
        status = await self._client.status(task_id, vehicle=anyone)
        self.named(status.vehicle)
        return status
