"""Submissions as tasks of the protocol: the extension ``io.modelcontextprotocol/tasks`` (SEP-2663).

A client that has the extension gets a task from ``submit`` at once, and polls it with tasks/get;
other clients get the same from the tools. The task server keeps the tasks, so that they outlive
this process: an id names the rover, its task, and the nonce by which the task is recognised.

A held task is *input required*: it asks how to release it. The question's key has the halt epoch,
so that an answer to an older question does nothing. A task that failed is *completed* with an
error: *failed* is only for errors of the protocol.
"""

import re
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Any, Literal, NamedTuple

from mav_tasks.agents.advice import advice_of
from mav_tasks.agents.forms import result, task_form
from mav_tasks.agents.rovers import Rovers
from mav_tasks.basics.errors import Refused, UsageError
from mav_tasks.client.descriptions import needs_decision, state_of, what_of, why_of
from mav_tasks.client.values import TaskStatus
from mav_tasks.mavlink.enums import MavResult
from mav_tasks.tasks.lifecycle import TaskReason, TaskState

EXTENSION = "io.modelcontextprotocol/tasks"
POLL = 1000  # ms
REMEMBERED = 1000  # tasks whose first sight is remembered
RELEASES: tuple[Literal["again", "remainder", "skip"], ...] = ("remainder", "again", "skip")
CANCELLED = (TaskState.CANCELLED, TaskState.KILLED)
ID = re.compile(r"([0-9]{1,3})-([0-9]{1,10})-([0-9]{1,10})", re.ASCII)


class _Seen(NamedTuple):
    created: datetime
    updated: datetime
    version: int


class Durable:
    """The tasks that agents poll."""

    def __init__(self, rovers: Rovers) -> None:
        self._rovers = rovers
        self._seen: dict[str, _Seen] = {}

    def created(self, status: TaskStatus) -> dict[str, Any]:
        """Return the answer to a submission in place of its result."""
        return {"resultType": "task", **self._task(status, "working")}

    async def get(self, task_id: str) -> dict[str, Any]:
        """Return a task with its result or its question. Raise Refused if it is unknown."""
        status = await self._status(task_id)
        if needs_decision(status):
            return self._task(status, "input_required") | {"inputRequests": _question(status)}
        if not status.is_over:
            return self._task(status, "working")
        if status.state in CANCELLED:
            return self._task(status, "cancelled")
        return self._task(status, "completed") | {"result": _result(status)}

    async def update(self, task_id: str, answers: Mapping[str, Any]) -> None:
        """Release a held task as an answer says. Ignore answers to other questions."""
        status = await self._status(task_id)
        answer = answers.get(_key(status))
        if not needs_decision(status) or not isinstance(answer, Mapping):
            return
        content = answer.get("content")
        how = content.get("how") if isinstance(content, Mapping) else None
        if answer.get("action") != "accept":
            return
        for each in RELEASES:
            if how == each:
                client = await self._rovers.client()
                epoch, vehicle = status.halt_epoch, status.vehicle
                await client.release(status.id, each, epoch=epoch, vehicle=vehicle)
                return
        raise UsageError(f"how {how!r}: expected one of {', '.join(RELEASES)}")

    async def cancel(self, task_id: str) -> None:
        """Cancel a task; one that has ended stays as it is."""
        status = await self._status(task_id)
        client = await self._rovers.client()
        try:
            await client.cancel(status.id, vehicle=status.vehicle)
        except Refused as error:
            if error.reason != TaskReason.WRONG_STATE:
                raise

    async def _status(self, task_id: str) -> TaskStatus:
        """Return the status of a task. Raise Refused if the server has no such task."""
        found = ID.fullmatch(task_id)
        if found is None:
            raise _unknown(task_id)
        vehicle, number, nonce = map(int, found.groups())
        client = await self._rovers.client()
        status = await client.status(number, vehicle=self._rovers.named(vehicle))
        if (status.vehicle, status.nonce) != (vehicle, nonce):
            raise _unknown(task_id)
        return status

    def _task(self, status: TaskStatus, state: str) -> dict[str, Any]:
        task_id = f"{status.vehicle}-{status.id}-{status.nonce}"
        seen = self._note(task_id, status)
        why = why_of(status)
        words = f"{what_of(status)}: {state_of(status)}{f' ({why})' if why else ''}"
        advice = advice_of(status)
        return {
            "taskId": task_id,
            "status": state,
            "statusMessage": f"{words}. {advice}" if advice else words,
            "createdAt": seen.created.isoformat(timespec="seconds"),
            "lastUpdatedAt": seen.updated.isoformat(timespec="seconds"),
            "ttlMs": None,
            "pollIntervalMs": POLL,
        }

    def _note(self, task_id: str, status: TaskStatus) -> _Seen:
        """Return when this process first saw a task, and when it last changed.

        The server does not say when a task was submitted: after a restart of this process a task
        counts from when it is asked about.
        """
        now = datetime.now(UTC)
        before = self._seen.pop(task_id, None)
        created = now if before is None else before.created
        updated = now
        if before is not None and before.version == status.version:
            updated = before.updated
        if status.ended_ago is not None:
            updated = max(created, now - timedelta(seconds=status.ended_ago))
        seen = self._seen[task_id] = _Seen(created, updated, status.version)
        if len(self._seen) > REMEMBERED:
            del self._seen[next(iter(self._seen))]
        return seen


def _result(status: TaskStatus) -> dict[str, Any]:
    """Return the result of the call that submitted a finished task."""
    return result(task_form(status), is_error=status.state is not TaskState.COMPLETED)


def _key(status: TaskStatus) -> str:
    return f"release-{status.halt_epoch}"


def _question(status: TaskStatus) -> dict[str, Any]:
    """Return the question how to release a held task, as an elicitation."""
    how = {"type": "string", "enum": list(RELEASES), "title": "How to release the task"}
    schema = {"type": "object", "properties": {"how": how}, "required": ["how"]}
    params = {
        "mode": "form",
        "message": f"Task {status.id} of rover {status.vehicle} is held ({why_of(status)}). "
        "'remainder' finishes it, 'again' repeats it from here, 'skip' drops it.",
        "requestedSchema": schema,
    }
    return {_key(status): {"method": "elicitation/create", "params": params}}


def _unknown(task_id: str) -> Refused:
    words = f"no task {task_id!r}"
    return Refused(words, result=MavResult.DENIED, reason=TaskReason.NOT_FOUND)
