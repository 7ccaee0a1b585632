"""AI agents: ``mav-tasks mcp``, used by the SDK's own client, with a real server and rover."""

import asyncio
import http.client
import json
import re
import subprocess
import sys
from collections.abc import Awaitable, Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, Literal

import pytest

pytest.importorskip("mcp", reason="the MCP SDK is missing: pip install 'mav-tasks[mcp]'")

from mcp.client import Client
from mcp.client.extension import ClaimContext, ClientExtension, ResultClaim
from mcp.shared.exceptions import MCPError
from mcp_types import CallToolResult, Request, RequestParams, Result

from mav_tasks import SyncClient
from tests.kit.agents import Agent, agent, url_of
from tests.kit.awaited import awaited
from tests.kit.commands import called
from tests.kit.processes import Stand, environment_with, frozen, process, stand, wait_until

pytestmark = pytest.mark.slow

TOOLS = json.loads((Path(__file__).parents[1] / "golden/mcp_tools.json").read_text())
MOVE = {"kind": "move", "distance": 0.4}


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stand]:
    """One server and rover for most of them; each leaves the queue empty and not paused."""
    with stand(tmp_path_factory.mktemp("agents")) as it:
        yield it


@pytest.mark.parametrize("mode", ["auto", "legacy"])
@awaited
async def test_an_agent_drives_a_task_to_its_end(running: Stand, tmp_path: Path, mode: str) -> None:
    async with agent(running, tmp_path, mode=mode) as it:
        (rover,) = (await it.call("vehicles"))["vehicles"]
        assert (rover["vehicle"], rover["kind"], rover["heard"]) == (1, "ardupilot", True)
        assert rover["north"] is not None

        task = await it.drive(f"drive {mode}", MOVE, label="first")
        assert (task["what"], task["label"], task["is_over"]) == ("move 0.4 m", "first", False)
        again = await it.drive(f"drive {mode}", MOVE, label="first")
        assert again["id"] == task["id"]
        assert (await it.call("queue"))["current"]["id"] == task["id"]

        done = await it.call("wait", id=task["id"], seconds=20)
        assert (done["state"], done["is_over"], done["advice"]) == ("completed", True, "")
        steps = [progress for progress, _ in it.heard]
        assert steps == sorted(set(steps))
        assert len(steps) > 2
        assert it.heard[-1][1].endswith("completed")
        assert (await it.call("history", limit=1))["tasks"][0]["id"] == task["id"]
        assert (await it.call("task", id=task["id"]))["is_over"]


@awaited
async def test_stop_ends_the_task_and_only_a_present_epoch_resumes(
    running: Stand, tmp_path: Path
) -> None:
    async with agent(running, tmp_path) as it:
        task = await it.drive("stop", {"kind": "move", "distance": 5})
        before = await it.call("queue")
        await it.call("stop")
        assert (await it.call("wait", id=task["id"]))["state"] == "killed"
        queue = await it.call("queue")
        assert queue["paused"] == "stopped"
        assert f"epoch: {queue['halt_epoch']}" in queue["advice"]
        assert queue["halt_epoch"] > before["halt_epoch"]
        waiting = await it.drive("after the stop", MOVE)
        assert "The queue is paused (" in waiting["advice"]
        await it.call("cancel", id=waiting["id"])
        assert "epoch: missing" in await it.refused("resume")
        assert "epoch 0: not in 1..4294967295" in await it.refused("resume", epoch=0)
        assert await it.refused("resume", epoch=before["halt_epoch"])
        await it.call("resume", epoch=queue["halt_epoch"])
        assert (await it.call("queue"))["paused"] is None


#: a call, what it is refused with; KEY: an idempotency key
REFUSED = """submit "goals": [{"kind": "move", "distance": 1e6}], KEY => distance 1000000 not in
submit "goals": [{"kind": "home"}], "label": "ééééééééééééé", KEY => label
submit "goals": [{"kind": "home"}] => idempotency_key: missing
submit "goals": [{"kind": "home"}], "vehicle": 9, KEY => no rover 9
submit "goals": [], KEY => goals []: expected 1 to 100
submit "goals": [{"kind": "fly"}], KEY => goals[0].kind 'fly'
submit "goals": [{"kind": "home"}], "start_in": 1e9, KEY => start_in 1000000000.0: not in 0
task "id": 999999.0 => no task 999999
task "id": true => id True: not a number: 1..1065353215
release "id": 1, "how": "all", "epoch": 1 => how 'all': expected one of again, remainder, skip
queue "rover": 1 => rover: unknown; expected vehicle, limit"""


@awaited
async def test_a_refusal_is_the_result_of_a_call_with_its_reason(
    running: Stand, tmp_path: Path
) -> None:
    calls = REFUSED.replace("KEY", '"idempotency_key": "refused"')
    async with agent(running, tmp_path) as it:
        for tool, arguments, words in re.findall(r"(\w+) (.*) => (.*)", calls):
            assert words in await it.refused(tool, **json.loads(f"{{{arguments}}}"))
        offered = (await it.client.list_tools()).tools
        assert [each.model_dump(by_alias=True, exclude_none=True) for each in offered] == TOOLS
        with pytest.raises(MCPError, match="no tool 'fly'; there are vehicles"):
            await it.client.call_tool("fly", {})
        assert (await it.call("queue"))["waiting"] == []
    async with agent(running, tmp_path, "--read-only", "--vehicle", "1") as it:
        assert "only rover 1 is offered" in await it.refused("queue", vehicle=2)
        with pytest.raises(MCPError, match="no tool 'submit'"):
            await it.call("submit")


OTHERS = """{"goals": [{"kind": "move", "distance": 0.5}]}
{"goals": [{"kind": "move", "distance": 0.4}, {"kind": "move", "distance": 0.4}]}
{"priority": 6}
{"start_in": 901}
{"deadline": 600}
{"label": "another"}"""


@awaited
async def test_a_key_with_other_content_is_refused(running: Stand, tmp_path: Path) -> None:
    first = {"goals": [MOVE], "start_in": 900, "idempotency_key": "content"}
    async with agent(running, tmp_path) as it:
        task = await it.call("submit", **first)
        for other in map(json.loads, OTHERS.splitlines()):
            assert await it.refused("submit", **(first | other)) == (
                "idempotency_key 'content': it was used for another task;"
                " repeat that exactly, or use a new key"
            )
        assert (await it.call("submit", **first))["id"] == task["id"]
        await it.call("cancel", id=task["id"])
        assert (await it.call("submit", **first))["state"] == "cancelled"


@contextmanager
def asking(running: Stand, folder: Path, line: str) -> Iterator[subprocess.Popen[str]]:
    """An agent's process that is sent a line, for a ``with`` block."""
    with subprocess.Popen(
        [sys.executable, "-m", "mav_tasks.cli", "mcp", "--server", url_of(running)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment_with(XDG_CONFIG_HOME=str(folder)),
    ) as it:
        assert it.stdin is not None
        it.stdin.write(line + "\n")
        it.stdin.flush()
        yield it
        it.kill()


def test_one_that_is_killed_before_its_answer_and_asks_again_has_one_task(
    running: Stand, tmp_path: Path
) -> None:
    order = {"goals": [MOVE], "start_in": 900, "idempotency_key": "killed"}
    call = {"name": "submit", "arguments": order, "_meta": meta("2026-07-28")}
    line = json.dumps({"jsonrpc": "2.0", "id": 1, "method": "tools/call", "params": call})
    with SyncClient(url_of(running)) as client:
        with asking(running, tmp_path, line):
            wait_until(lambda: client.queue().waiting_count, within=40, what="its task")
        with asking(running, tmp_path, line) as again:
            assert again.stdout is not None
            answer = json.loads(again.stdout.readline())
        (task,) = client.queue().waiting
        assert answer["result"]["structuredContent"]["id"] == task.id
        client.cancel(task.id)


INFO = {"name": "a", "version": "1"}


def meta(version: str) -> dict[str, Any]:
    """Return what each request of an agent has without a session."""
    return {
        "io.modelcontextprotocol/protocolVersion": version,
        "io.modelcontextprotocol/clientInfo": INFO,
        "io.modelcontextprotocol/clientCapabilities": {},
    }


class GetParams(RequestParams):
    task_id: str


class UpdateParams(GetParams):
    input_responses: dict[str, Any]


class GetTask(Request[GetParams, Literal["tasks/get"]]):
    method: Literal["tasks/get"] = "tasks/get"
    name_param = "taskId"


class UpdateTask(Request[UpdateParams, Literal["tasks/update"]]):
    method: Literal["tasks/update"] = "tasks/update"
    name_param = "taskId"


class Seed(Result):
    task_id: str
    status: str
    status_message: str
    created_at: str
    last_updated_at: str
    ttl_ms: int | None
    poll_interval_ms: int


class Shown(Seed):
    result: dict[str, Any] | None = None
    input_requests: dict[str, Any] | None = None


class Created(Seed):
    result_type: Literal["task"] = "task"


class Empty(Result):
    result_type: str


class Tasks(ClientExtension):
    """A client's side of the extension: it keeps the tasks that calls have become."""

    identifier = "io.modelcontextprotocol/tasks"

    def __init__(self) -> None:
        self.created: list[Created] = []

    def claims(self) -> list[ResultClaim[Any]]:
        return [ResultClaim(result_type="task", model=Created, resolve=self._resolve)]

    async def _resolve(self, created: Created, _context: ClaimContext) -> CallToolResult:
        self.created.append(created)
        return CallToolResult(content=[], structured_content=None, is_error=True)


async def shown(it: Agent, task_id: str, *, until: tuple[str, ...]) -> Shown:
    """Poll a task until it has one of these statuses."""
    for _ in range(300):
        request = GetTask(params=GetParams(task_id=task_id))
        found = await it.client.session.send_request(request, Shown)
        if found.status in until:
            return found
        await it.call("wait", id=int(task_id.split("-")[1]), seconds=1)
    raise AssertionError(found)


async def accepted(request: Callable[[], Awaitable[None]]) -> None:
    """Send a request until the server, which stood still, knows its order and the position."""
    for _ in range(100):
        try:
            return await request()
        except MCPError as refused:
            if not any(why in str(refused) for why in ("delayed by the server", "no position")):
                raise
            await asyncio.sleep(0.1)
    raise AssertionError("not accepted")


@awaited
async def test_a_held_task_requires_input(running: Stand, tmp_path: Path) -> None:
    tasks = Tasks()
    async with agent(running, tmp_path, extensions=[tasks]) as it:
        move = {"kind": "move", "distance": 3}  # it runs on for 3 s when the server stands still
        await it.client.call_tool("submit", {"goals": [move], "idempotency_key": "late"})
        task_id = tasks.created[0].task_id
        number = int(task_id.split("-")[1])
        wait_until(lambda: running.speed() > 0.3, within=15, what="the rover at speed")
        with frozen(running.server):
            wait_until(lambda: running.speed() < 0.01, within=15, what="the rover to stop")
        held = await shown(it, task_id, until=("input_required",))
        assert held.input_requests is not None
        ((key, question),) = held.input_requests.items()
        assert question["method"] == "elicitation/create"
        assert "how" in question["params"]["requestedSchema"]["properties"]

        async def answer(key: str, action: str, how: str) -> None:
            answers = {key: {"action": action, "content": {"how": how}}}
            params = UpdateParams(task_id=task_id, input_responses=answers)
            await it.client.session.send_request(UpdateTask(params=params), Empty)

        await answer("release-1", "accept", "skip")  # to an older question
        await answer(key, "decline", "skip")
        with pytest.raises(MCPError, match="how 'all': expected one of remainder"):
            await answer(key, "accept", "all")
        assert (await it.call("wait", id=number))["state"] == "held"
        assert f"Task {number} is held" in (await it.call("queue"))["advice"]
        await it.client.call_tool("submit", {"goals": [MOVE], "idempotency_key": "behind"})
        assert "release the held task before it" in tasks.created[1].status_message
        await it.call("cancel", id=number + 1)
        await accepted(lambda: answer(key, "accept", "remainder"))
        queue = await it.call("queue")
        if queue["paused"]:
            await it.call("resume", epoch=queue["halt_epoch"])
        done = await shown(it, task_id, until=("completed", "failed", "cancelled"))
        assert done.result is not None
        assert done.result["structuredContent"]["state"] == "completed"


@pytest.fixture
def over_http(running: Stand, tmp_path: Path) -> Iterator[str]:
    """The URL of a process that serves HTTP."""
    options = "mcp", "--http", "127.0.0.1:0", "--server", url_of(running)
    with process("-m", "mav_tasks.cli", *options, folder=tmp_path, name="http") as it:
        yield it.wait_for(r"agents can use (http://\S+)")[1]
        assert it.end() < 5


@awaited
async def test_an_agent_drives_by_http(over_http: str) -> None:
    async with Client(over_http) as one, Client(over_http, mode="legacy") as other:
        first, second = Agent(one), Agent(other)
        task = await first.drive("by http", MOVE)
        assert (await second.drive("by http", MOVE))["id"] == task["id"]
        done = await second.call("wait", id=task["id"], seconds=20)
        assert done["state"] == "completed"
        assert second.heard


def asked(place: str, version: str, name: str = "a", **headers: str) -> int:
    """Return the status of the first request of a program of this name, sent in two pieces."""
    info = {"name": name, "version": "1"}
    legacy = {"protocolVersion": version, "capabilities": {}, "clientInfo": info}
    is_legacy = version.startswith("2025")
    method = "initialize" if is_legacy else "tools/list"
    params = legacy if is_legacy else {"_meta": meta(version)}
    body = json.dumps({"jsonrpc": "2.0", "id": 1, "method": method, "params": params}).encode()
    kinds = {"Content-Type": "application/json", "Accept": "application/json, text/event-stream"}
    about = {"MCP-Protocol-Version": version, "Mcp-Method": method}
    with closing(http.client.HTTPConnection(place, timeout=10)) as connection:
        connection.request("POST", "/mcp", iter([body[:9], body[9:]]), kinds | about | headers)
        return connection.getresponse().status


#: status, host and origin
PAGES = """421 evil.example http://PLACE
421 127.0.0.1.evil.example:80 http://PLACE
403 PLACE http://evil.example
200 PLACE http://PLACE"""


def test_a_page_from_elsewhere_cannot_use_it(over_http: str) -> None:
    place = over_http.removeprefix("http://").removesuffix("/mcp")
    for row in PAGES.replace("PLACE", place).splitlines():
        status, host, origin = row.split()
        for version in ("2026-07-28", "2025-11-25"):
            assert asked(place, version, Host=host, Origin=origin) == int(status), (row, version)
    assert asked(place, "2025-11-25", name="a" * 70_000) == 413


def test_a_port_in_use_is_named(over_http: str) -> None:
    place = over_http.removeprefix("http://").removesuffix("/mcp")
    for command in ("mcp --http", "web --listen"):
        in_use = called(*command.split(), place)
        words = f"mav-tasks: {command[4:]} {place}: Address already in use: end the program that"
        assert in_use.status == 2
        assert in_use.error == f"{words} has it (ss -lntup names it), or choose another\n"


def test_only_the_protocol_is_on_standard_output(running: Stand, tmp_path: Path) -> None:
    """Also if a library prints something; what is no message is answered as an error, or not."""
    script = (
        "import builtins, mav_tasks.agents.rovers as r\n"
        "from mav_tasks.cli.app import main\n"
        "async def all(self, before=r.Rovers.all):\n"
        "    print('noise')\n"
        "    return await before(self)\n"
        "r.Rovers.all = all\n"
        f"main(['mcp', '--server', '{url_of(running)}'])\n"
    )
    call = {"name": "vehicles", "arguments": {}}
    begin = {"protocolVersion": "2025-11-25", "capabilities": {}, "clientInfo": INFO}
    lines = [
        json.dumps({"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": begin}),
        json.dumps({"jsonrpc": "2.0", "method": "notifications/initialized"}),
        "this is no message",
        json.dumps({"jsonrpc": "2.0", "id": 2, "method": "tools/call", "params": call}),
    ]
    with subprocess.Popen(
        [sys.executable, "-c", script],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        env=environment_with(XDG_CONFIG_HOME=str(tmp_path)),
    ) as it:
        assert it.stdin is not None
        assert it.stdout is not None
        assert it.stderr is not None
        it.stdin.write("\n".join(lines) + "\n")
        it.stdin.flush()
        messages: list[dict[str, Any]] = []
        while not any(each.get("id") == 2 for each in messages):
            messages.append(json.loads(it.stdout.readline()))
        it.stdin.close()
        assert it.stdout.read() == ""
        assert it.wait(10) == 0
        assert "noise" in it.stderr.read()
    assert all(each["jsonrpc"] == "2.0" for each in messages)
