"""A client for one command, opened with the command's options."""

from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from typing import Literal

from mav_tasks.basics.errors import LinkDown, NoAnswer, UsageError
from mav_tasks.cli import output
from mav_tasks.cli.options import Common, Reach
from mav_tasks.client.aio import Client
from mav_tasks.client.handle import Task
from mav_tasks.client.values import News, QueueStatus, Text
from mav_tasks.mavlink.signing import Key
from mav_tasks.tasks.task import ANY

NO_ROVER = "has heard no rover"  # of an answer (``client/fleet_view.py``)
CHOSEN = " chosen: "  # in the text of a new task (``engine/commands/submissions.py``)


@asynccontextmanager
async def opened(common: Reach) -> AsyncIterator[Client]:
    """Yield a client that has found the server and the rovers."""
    async with unfound(common) as client:
        await client.found()
        for number in client.shared_ids():
            words = f"two rovers have the id {number}: one is driven, the other one ignored"
            output.warn(f"{words}; give one of them another id (SYSID_THISMAV, MAV_SYS_ID)")
        yield client


def signing_key(common: Reach) -> Key | None:
    """Return the key of ``--sign``; None without it. Raise KeyRingError if there is no such key."""
    if common.keys and not common.sign:
        raise UsageError("--keys needs --sign NAME")
    if not common.sign:
        return None
    from mav_tasks.cli.ring import key_to_sign_with  # noqa: PLC0415  # only to sign

    return key_to_sign_with(common.sign, common.keys)


@asynccontextmanager
async def unfound(common: Reach) -> AsyncIterator[Client]:
    """Yield a client whose link is open, without waiting for the server."""
    key = signing_key(common)
    client = Client(common.server, vehicle=common.vehicle or None, timeout=common.timeout, key=key)
    client.open()
    try:
        yield client
    except NoAnswer as error:
        # else the server may answer only signed packets
        is_clear = isinstance(error, LinkDown) or NO_ROVER in str(error)
        if common.sign or client.vehicles() or is_clear:
            raise
        raise NoAnswer(
            f"{error} (if the server requires signatures, use --sign NAME)", nonce=error.nonce
        ) from None
    finally:
        await client.close()


@contextmanager
def values_checked() -> Iterator[None]:
    """Raise UsageError for a ValueError of the library: a wrong value on the command line."""
    try:
        yield
    except ValueError as error:
        raise UsageError(str(error)) from error


class ChoiceHeard:
    """Hears why the server chose the rover of a new task for any rover."""

    def __init__(self) -> None:
        self._texts: list[str] = []

    def listen(self, news: News) -> None:
        """Keep a text of a task server."""
        if isinstance(news, Text):
            self._texts.append(news.words)

    def hint(self, task: Task) -> str:
        """Return why, to end a line about a task; "" if nothing was heard, or it was named."""
        for words in self._texts:
            about, _, why = words.partition(CHOSEN)
            if why and about.startswith(f"Task {task.id} "):
                return f": {why}"
        return ""


def rover_of(common: Common) -> Literal["any"] | None:
    """Return the argument ``vehicle`` of the library for a new task; None: the client's rover."""
    return "any" if common.vehicle == ANY else None


def is_alone(client: Client, common: Common) -> bool:
    """Return whether the server has one rover, so that a command need not name it."""
    return common.vehicle is None and len(client.vehicles()) == 1


async def find_task(client: Client, common: Common, task_id: int) -> Task:
    """Return a task by its id. Without --vehicle, ask any rover's server for the task's rover."""
    vehicle = common.vehicle
    if vehicle is None:
        anyone = client.vehicles()[0].id
        vehicle = (await client.status(task_id, vehicle=anyone)).vehicle
    return await client.task(task_id, vehicle=vehicle)


async def queues_of(client: Client, common: Common, *, limit: int) -> list[QueueStatus]:
    """Return the queue of the named rover, or of all rovers."""
    meant = [each.id for each in client.vehicles() if common.vehicle in (None, each.id)]
    return [await client.queue(vehicle=vehicle, limit=limit) for vehicle in meant]
