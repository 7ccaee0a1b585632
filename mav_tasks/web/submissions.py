"""Submits tasks for the API: each idempotency key once, however often the request is repeated.

A single goal is sent as a plan, too: the server compares a whole plan with the earlier one of the
same key.
"""

from collections.abc import Mapping
from typing import Any

from mav_tasks.basics.errors import Refused
from mav_tasks.client.aio import Client
from mav_tasks.client.handle import Task
from mav_tasks.client.idempotency import LONGEST, numbers_of
from mav_tasks.client.plan_sources import Plan
from mav_tasks.client.terms import AnyRover, requested
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.web.problems import Problem, invalid

KEY = "idempotency-key"


async def submit(
    client: Client,
    plan: Plan,
    *,
    vehicle: int | AnyRover,
    terms: Mapping[str, Any],
    headers: Mapping[str, str],
    by: str,
) -> Task:
    """Submit a task. Return it once it is durable. Raise Problem for a key of another task."""
    key = headers.get(KEY)
    wished = requested(terms)
    numbers: dict[str, int] = {}
    if key is not None:
        if not 0 < len(key) <= LONGEST:
            raise invalid(f"Idempotency-Key: expected 1 to {LONGEST} characters")
        numbers = numbers_of(f"{by} {key}", wished)._asdict()
    try:
        return await client.submit_mission(plan, vehicle=vehicle, **wished, **numbers)
    except Refused as error:
        is_reused = bool(numbers) and error.reason in (0, TaskReason.NONCE_REUSED)
        if not is_reused or f"nonce {numbers['nonce']} " not in str(error):
            raise
        words = "this Idempotency-Key was used for another task: repeat that, or use a new key"
        raise Problem(409, "Key was used", words, reason="nonce_reused") from error
