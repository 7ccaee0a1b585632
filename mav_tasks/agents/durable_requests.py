"""The requests of the extension for tasks: tasks/get, tasks/update, tasks/cancel."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from mcp.server.lowlevel import Server
from mcp.shared.exceptions import MCPError
from mcp_types import INTERNAL_ERROR, INVALID_PARAMS, RequestParams
from mcp_types.version import MODERN_PROTOCOL_VERSIONS

from mav_tasks.agents.durable import EXTENSION, Durable
from mav_tasks.basics.errors import ClientError, NoAnswer, UsageError


class TaskParams(RequestParams):
    """The parameters of tasks/get and tasks/cancel."""

    task_id: str


class UpdateParams(TaskParams):
    """The parameters of tasks/update."""

    input_responses: dict[str, Any]


class DurableRequests:
    """The answers to these requests; a refusal is an error of the protocol here."""

    def __init__(self, durable: Durable) -> None:
        self._durable = durable

    def serve(self, server: Server[Any]) -> None:
        """Let a server answer these requests, and offer the extension."""
        server.extensions[EXTENSION] = {}
        server.add_request_handler("tasks/get", TaskParams, self._get)
        server.add_request_handler("tasks/update", UpdateParams, self._update)
        server.add_request_handler("tasks/cancel", TaskParams, self._cancel)

    async def _get(self, _context: Any, params: TaskParams) -> dict[str, Any]:
        with _protocol_errors():
            return await self._durable.get(params.task_id)

    async def _update(self, _context: Any, params: UpdateParams) -> dict[str, Any]:
        with _protocol_errors():
            await self._durable.update(params.task_id, params.input_responses)
        return {}

    async def _cancel(self, _context: Any, params: TaskParams) -> dict[str, Any]:
        with _protocol_errors():
            await self._durable.cancel(params.task_id)
        return {}


def has_tasks(context: Any) -> bool:
    """Return whether the client of a request has the extension: else it cannot read a task."""
    if context.protocol_version not in MODERN_PROTOCOL_VERSIONS:
        return False
    capabilities = context.session.client_capabilities
    return capabilities is not None and EXTENSION in (capabilities.extensions or {})


@contextmanager
def _protocol_errors() -> Iterator[None]:
    """Raise MCPError for what the task server refuses, and if it does not answer."""
    try:
        yield
    except NoAnswer as error:
        raise MCPError(code=INTERNAL_ERROR, message=str(error)) from error
    except (UsageError, ClientError) as error:
        raise MCPError(code=INVALID_PARAMS, message=str(error)) from error
