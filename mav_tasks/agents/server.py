"""The MCP server: its tools, and the errors that agents read instead of a broken call.

A refusal of the task server, or a wrong argument, becomes the result of the call, with its reason.
Errors of the protocol are only for faults that a program must correct.
"""

from importlib.metadata import version
from typing import Any

from mcp.server.lowlevel import Server
from mcp.shared.exceptions import MCPError
from mcp_types import (
    INVALID_PARAMS,
    CallToolRequestParams,
    ListToolsResult,
    PaginatedRequestParams,
    ToolAnnotations,
)
from mcp_types import Tool as ToolForm

from mav_tasks.agents.driving import STOP, driving
from mav_tasks.agents.durable import Durable
from mav_tasks.agents.durable_requests import DurableRequests, has_tasks
from mav_tasks.agents.forms import refusal, result
from mav_tasks.agents.reading import READING
from mav_tasks.agents.rovers import Rovers
from mav_tasks.agents.tool import Tool
from mav_tasks.basics.errors import ClientError, UsageError
from mav_tasks.config.setting_keys.parts import read_all, schema_of

INSTRUCTIONS = """\
Rovers that drive on the ground, and their queues of tasks. Read vehicles and queue first. Submit \
a task with an idempotency_key of your own, then call wait until it has ended. Each task has \
'advice': what to do now. Call stop whenever you are in doubt; a person decides when to resume."""


def server_of(rovers: Rovers, *, is_read_only: bool, limits: str = "") -> Server[Any]:
    """Return the MCP server for these rovers; ``is_read_only``: it can only read and stop.

    ``limits``: those of the agents' key, as text.
    """
    server: Server[Any] = Server(
        "mav-tasks", version=version("mav-tasks"), instructions=INSTRUCTIONS
    )
    durable = None if is_read_only else Durable(rovers)
    tools = (*READING, STOP) if is_read_only else (*READING, *driving(limits))
    calls = Calls(rovers, tools, durable)
    server.add_request_handler("tools/list", PaginatedRequestParams, calls.list)
    server.add_request_handler("tools/call", CallToolRequestParams, calls.call)
    if durable is not None:
        DurableRequests(durable).serve(server)
    return server


class Calls:
    """The tools that are offered, and the calls of them."""

    def __init__(self, rovers: Rovers, tools: tuple[Tool, ...], durable: Durable | None) -> None:
        self._rovers = rovers
        self._tools = {tool.name: tool for tool in tools}
        self._durable = durable

    async def list(self, _context: Any, _params: PaginatedRequestParams) -> ListToolsResult:
        """Return the tools."""
        return ListToolsResult(tools=[_form(tool) for tool in self._tools.values()])

    async def call(self, context: Any, params: CallToolRequestParams) -> dict[str, Any]:
        """Run a tool. Raise MCPError if there is no such tool; any other refusal is its result."""
        tool = self._tools.get(params.name)
        if tool is None:
            words = f"no tool {params.name!r}; there are {', '.join(self._tools)}"
            raise MCPError(code=INVALID_PARAMS, message=words)

        async def report(progress: float, message: str) -> None:
            await context.session.report_progress(progress, 1.0, message)

        try:
            values = read_all(tool.arguments, params.arguments or {})
            form = await tool.run(self._rovers, values, report)
            if tool.makes_a_task and self._durable is not None and has_tasks(context):
                return self._durable.created(await self._rovers.status(form["id"]))
        except (UsageError, ClientError, ValueError) as error:
            return refusal(str(error))
        return result(form)


def _form(tool: Tool) -> ToolForm:
    """Return a tool as agents read it. All tools can be repeated: with the same arguments they
    change nothing more.
    """
    hints = ToolAnnotations(
        title=tool.title,
        read_only_hint=tool.is_reading,
        destructive_hint=tool.is_destructive,
        idempotent_hint=True,
        open_world_hint=False,
    )
    return ToolForm(
        name=tool.name,
        title=tool.title,
        description=tool.about,
        input_schema=schema_of(tool.arguments),
        output_schema=dict(tool.returns),
        annotations=hints,
    )
