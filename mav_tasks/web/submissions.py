"""Submits tasks for the API: each idempotency key once, however often the request is repeated.

A single goal is sent as a plan, too: the server compares a whole plan with the earlier one of the
same key.
"""

from collections.abc import Mapping
from typing import Any

from mav_tasks.basics.errors import Refused
from mav_tasks.client.aio import Client
from mav_tasks.client.asking import moment_of, repeat_of
from mav_tasks.client.handle import Task
from mav_tasks.client.idempotency import LONGEST, numbers_of
from mav_tasks.client.parts import AFTER, AT, CRON, DEADLINE, DELAY, EVERY, LABEL, PRIORITY
from mav_tasks.client.plan_sources import Plan
from mav_tasks.client.terms import AnyRover
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import DEFAULT_PRIORITY
from mav_tasks.web.problems import Problem, invalid

KEY = "idempotency-key"
TERMS = (PRIORITY, AFTER, DELAY, AT, DEADLINE, LABEL, EVERY, CRON)


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
    label = terms["label"] or ""
    repeat = repeat_of(terms)
    numbers: dict[str, int] = {}
    if key is not None:
        if not 0 < len(key) <= LONGEST:
            raise invalid(f"Idempotency-Key: expected 1 to {LONGEST} characters")
        named = f"{label}\0{repeat}" if repeat else label
        numbers = numbers_of(f"{by} {key}", label=named)._asdict()
    try:
        return await client.submit_mission(
            plan,
            vehicle=vehicle,
            priority=DEFAULT_PRIORITY if terms["priority"] is None else terms["priority"],
            after=terms["after"] or 0,
            delay=terms["delay"] or 0.0,
            at=moment_of(terms["at"]),
            deadline=terms["deadline"] or 0.0,
            label=label,
            every=repeat or 0.0,
            **numbers,
        )
    except Refused as error:
        is_reused = bool(numbers) and error.reason in (0, TaskReason.NONCE_REUSED)
        if not is_reused or f"nonce {numbers['nonce']} " not in str(error):
            raise
        words = "this Idempotency-Key was used for another task: repeat that, or use a new key"
        raise Problem(409, "Key was used", words, reason="nonce_reused") from error
