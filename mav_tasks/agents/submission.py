"""Submits an agent's task: once for each idempotency key. The task server checks its rights.

A single goal is submitted as a plan, too. A plan carries its goals and all its options at once, so
the server compares all of them with an earlier submission of the same key.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mav_tasks.agents.rovers import Rovers
from mav_tasks.basics.errors import NoAnswer, Refused, UsageError
from mav_tasks.client.aio import Client
from mav_tasks.client.descriptions import state_of
from mav_tasks.client.idempotency import Numbers, numbers_of
from mav_tasks.client.terms import CommonTerms, requested
from mav_tasks.client.values import TaskStatus
from mav_tasks.client.wire import Goal
from mav_tasks.kinds.in_json import goals_of
from mav_tasks.tasks.deduplicator import NONCE_KEPT
from mav_tasks.tasks.lifecycle import TERMINAL

LOOKED_AT = 100  # waiting, and finished, tasks of the rover
MARGIN = 60.0  # s before the server forgets a nonce; a submission takes less


@dataclass(frozen=True, slots=True)
class Wish:
    """What an agent asks for. ``key`` is its idempotency key, ``rover`` its system id."""

    rover: int
    goals: Sequence[Goal]
    key: str
    terms: CommonTerms

    @classmethod
    def of(cls, rover: int, values: dict[str, Any]) -> "Wish":
        """Return the wish in a tool's arguments. Raise SettingError if a goal is invalid."""
        terms = requested(values | {"delay": values["start_in"]})
        return cls(rover, goals_of(values["goals"]), values["idempotency_key"], terms)


async def submit(rovers: Rovers, wish: Wish) -> TaskStatus:
    """Submit a task, or find the task of an earlier submission with this key.

    Raise UsageError if the key is used up; Refused, NoAnswer as the client.
    """
    client = await rovers.client()
    # a key belongs to its submitter: another one's equal key has another nonce
    numbers = numbers_of(f"{rovers.signer} {wish.key}".lstrip(), wish.terms)
    earlier = await _looked_up(client, wish.rover, numbers)
    if earlier is not None and (earlier.ended_ago or 0.0) > NONCE_KEPT - MARGIN:
        words = f"it was task {earlier.id}, {state_of(earlier)} {earlier.ended_ago:.0f} s ago"
        raise UsageError(f"{_of(wish)}: {words}. To drive again, use a new key")
    try:
        task = await client.submit_mission(
            wish.goals, vehicle=wish.rover, **numbers._asdict(), **wish.terms
        )
        return await task.refresh()
    except NoAnswer as error:
        words = "The task may exist: submit the same again with the same idempotency_key"
        raise NoAnswer(f"{error}. {words}", nonce=numbers.nonce) from error
    except Refused as error:
        if f"nonce {numbers.nonce} " not in str(error):
            raise
        words = "it was used for another task; repeat that exactly, or use a new key"
        raise Refused(f"{_of(wish)}: {words}", result=error.result, reason=error.reason) from error


def _of(wish: Wish) -> str:
    return f"idempotency_key {wish.key!r}"


async def _looked_up(client: Client, rover: int, numbers: Numbers) -> TaskStatus | None:
    """Return the rover's task with this key, if any.

    The server does not compare the keys of tasks that ended long ago, but it still lists them.
    Raise NoAnswer if some of them are lost on the way: one may be the key's.
    """
    queue = await client.queue(vehicle=rover, limit=LOOKED_AT)
    over = await client.history(vehicle=rover, limit=LOOKED_AT)
    if len(over) < min(LOOKED_AT, sum(queue.counts.get(state, 0) for state in TERMINAL)):
        raise NoAnswer("the finished tasks did not all arrive: nothing was submitted, try again")
    current = () if queue.current is None else (queue.current,)
    tasks = (*current, *queue.waiting, *over)
    return next((task for task in tasks if task.nonce == numbers.nonce), None)
