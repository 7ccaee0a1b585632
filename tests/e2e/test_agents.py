"""AI agents: ``mav-tasks mcp``, used by the SDK's own client, with a real server and rover."""

import asyncio
import http.client
import json
import re
import signal
import subprocess
import sys
from collections.abc import Awaitable, Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Literal

import pytest

pytest.importorskip("mcp", reason="the MCP SDK is missing: pip install 'mav-tasks[mcp]'")

from mcp.client import Client
from mcp.client.extension import ClaimContext, ClientExtension, ResultClaim
from mcp.shared.exceptions import MCPError
from mcp_types import CallToolResult, Request, RequestParams, Result

from tests.kit.agents import Agent, agent, url_of
from tests.kit.awaited import awaited
from tests.kit.commands import called, mav_tasks
from tests.kit.processes import Process, Stand, environment_with, frozen, process, stand, wait_until

pytestmark = pytest.mark.slow

MOVE = {"kind": "move", "distance": 0.4}
READING = {"vehicles", "queue", "history", "task", "wait"}
DRIVING = {"submit", "cancel", "release", "pause", "resume"}


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stand]:
    """One server and rover for most of them; each leaves the queue empty and not paused."""
    with stand(tmp_path_factory.mktemp("agents")) as it:
        yield it


def serve(folder: Path, it: Stand, name: str) -> AbstractContextManager[Process]:
    """The next server on the store of a stand, at the same ports."""
    return process(
        *("-m", "mav_tasks.cli", "serve", "--no-push"),
        *("--client", f"udpin:127.0.0.1:{it.client_port}"),
        *("--vehicle", f"udpout:127.0.0.1:{it.rover_port}"),
        *("--store", str(folder / "tasks.sqlite3")),
        folder=folder,
        name=name,
    )


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
        assert await it.call("task", id=task["id"]) == done


@awaited
async def test_several_goals_are_one_task_and_a_wait_may_end_before_it(
    running: Stand, tmp_path: Path
) -> None:
    async with agent(running, tmp_path) as it:
        goals = {"kind": "rotate", "angle": 20}, {"kind": "wait", "duration": 600}
        task = await it.drive("several", *goals)
        shown = await it.call("wait", id=task["id"], seconds=0.5)
        assert not shown["is_over"]
        await it.call("cancel", id=task["id"])
        ended = await it.call("wait", id=task["id"])
        assert ended["state"] == "cancelled"
        assert "no tool" not in await it.refused("cancel", id=task["id"])


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
        assert "epoch: missing" in await it.refused("resume")
        assert "epoch: expected at least 1" in await it.refused("resume", epoch=0)
        assert await it.refused("resume", epoch=before["halt_epoch"])
        await it.call("resume", epoch=queue["halt_epoch"])
        assert (await it.call("queue"))["paused"] is None


@awaited
async def test_a_refusal_is_the_result_of_a_call_with_its_reason(
    running: Stand, tmp_path: Path
) -> None:
    async with agent(running, tmp_path) as it:
        key = {"idempotency_key": "refused"}
        far = await it.refused("submit", goals=[{"kind": "move", "distance": 1e6}], **key)
        assert "distance 1000000 not in" in far
        assert "label" in await it.refused("submit", goals=[MOVE], label="é" * 20, **key)
        assert "idempotency_key: missing" in await it.refused("submit", goals=[MOVE])
        assert "no rover 9" in await it.refused("submit", goals=[MOVE], vehicle=9, **key)
        assert "no task 999999" in await it.refused("task", id=999_999)
        assert "goals: expected at least 1" in await it.refused("submit", goals=[], **key)
        with pytest.raises(MCPError, match="no tool 'fly'; there are vehicles"):
            await it.client.call_tool("fly", {})
        assert (await it.call("queue"))["waiting"] == []


@pytest.mark.parametrize(
    "other",
    [
        {"goals": [{"kind": "move", "distance": 0.5}]},
        {"goals": [MOVE, MOVE]},
        {"priority": 6},
        {"start_in": 901},
        {"deadline": 600},
        {"label": "another"},
    ],
    ids=lambda other: next(iter(other)),
)
@awaited
async def test_a_key_with_other_content_is_refused(
    running: Stand, tmp_path: Path, other: dict[str, Any]
) -> None:
    key = f"content {other}"
    first = {"goals": [MOVE], "start_in": 900, "idempotency_key": key}
    async with agent(running, tmp_path) as it:
        task = await it.call("submit", **first)
        words = await it.refused("submit", **(first | other))
        assert words == (
            f"idempotency_key {key!r}: it was used for another task;"
            " repeat that exactly, or use a new key"
        )
        assert (await it.call("submit", **first))["id"] == task["id"]
        await it.call("cancel", id=task["id"])
        assert (await it.call("submit", **first))["state"] == "cancelled"


@awaited
async def test_an_agent_that_may_only_read_can_stop(running: Stand, tmp_path: Path) -> None:
    async with agent(running, tmp_path, "--read-only") as it:
        tools = {tool.name: tool for tool in (await it.client.list_tools()).tools}
        assert set(tools) == READING | {"stop"}
        with pytest.raises(MCPError, match="no tool 'submit'"):
            await it.client.call_tool("submit", {})
        await it.call("stop")
        queue = await it.call("queue")
        assert queue["paused"] == "stopped"
    assert mav_tasks("resume", server=url_of(running)).status == 0


@awaited
async def test_tools_say_what_they_may_change(running: Stand, tmp_path: Path) -> None:
    async with agent(running, tmp_path) as it:
        tools = {tool.name: tool for tool in (await it.client.list_tools()).tools}
        assert set(tools) == READING | DRIVING | {"stop"}
        hints = {name: tool.annotations for name, tool in tools.items()}
        assert {name for name, hint in hints.items() if hint and hint.read_only_hint} == READING
        moving = {name for name, hint in hints.items() if hint and hint.destructive_hint}
        assert moving == {"submit", "cancel", "release", "stop", "resume"}
        assert all(hint and hint.idempotent_hint for hint in hints.values())
        assert all(tool.output_schema and tool.description for tool in tools.values())


@pytest.mark.timeout(120)
@awaited
async def test_a_server_that_was_away_is_used_again_and_a_held_task_released(
    tmp_path: Path,
) -> None:
    store = str(tmp_path / "tasks.sqlite3")
    with stand(tmp_path, serve_store=store) as there:
        async with agent(there, tmp_path) as it:
            task = await it.drive("held", {"kind": "move", "distance": 1.5})
            wait_until(lambda: there.speed() > 0.3, within=15, what="the rover at speed")
            there.server.end(signal.SIGKILL)
            assert "no answer" in await it.refused("task", id=task["id"])
            with serve(tmp_path, there, "second") as second:
                second.wait_for("rover 1: found")
                held = await it.call("wait", id=task["id"], seconds=20)
                assert (held["state"], held["is_over"]) == ("held", False)
                assert "call release" in held["advice"]
                again = await it.drive("held", {"kind": "move", "distance": 1.5})
                assert again["id"] == task["id"]
                old = {"id": task["id"], "how": "remainder", "epoch": held["halt_epoch"] - 1}
                assert await it.refused("release", **(old | {"epoch": max(1, old["epoch"])}))
                await it.call("release", **(old | {"epoch": held["halt_epoch"]}))
                queue = await it.call("queue")
                if queue["paused"]:
                    await it.call("resume", epoch=queue["halt_epoch"])
                assert (await it.call("wait", id=task["id"]))["state"] == "completed"
                assert (await it.call("history"))["tasks"][0]["id"] == task["id"]


@awaited
async def test_a_server_that_is_not_there_yet_is_found_later(tmp_path: Path) -> None:
    store = str(tmp_path / "tasks.sqlite3")
    with stand(tmp_path, serve_store=store) as there:
        there.server.end()
        async with agent(there, tmp_path, "--timeout", "0.5") as it:
            assert "no task server answered" in await it.refused("vehicles")
            with serve(tmp_path, there, "second") as second:
                second.wait_for("rover 1: found")
                assert len((await it.call("vehicles"))["vehicles"]) == 1


@awaited
async def test_the_role_of_the_key_decides(tmp_path: Path) -> None:
    ring = str(tmp_path / "keys.toml")
    for name, role in (("watcher", "observer"), ("worker", "submitter")):
        assert called("keys", "add", name, "--role", role, "--keys", ring).status == 0
    with stand(tmp_path, "--keys", ring) as there:
        async with agent(there, tmp_path, "--sign", "watcher", "--keys", ring) as it:
            assert len((await it.call("vehicles"))["vehicles"]) == 1
            goals = {"goals": [MOVE], "idempotency_key": "observer"}
            assert "observer" in await it.refused("submit", **goals)
            await it.call("stop")
            epoch = (await it.call("queue"))["halt_epoch"]
            assert "observer" in await it.refused("resume", epoch=epoch)
        async with agent(there, tmp_path, "--sign", "worker", "--keys", ring) as it:
            task = await it.call("submit", **goals)
            assert "call resume" in task["advice"]
            assert "submitter" in await it.refused("resume", epoch=epoch)


AS_THE_GUIDE_SAYS = "keys add agent --role submitter --max-distance 50 --max-speed 0.5 --quota 5"


@awaited
async def test_the_server_keeps_the_limits_of_the_key(tmp_path: Path) -> None:
    ring = str(tmp_path / "keys.toml")
    limits = "--max-distance", "2", "--max-speed", "0.5", "--quota", "1", "--max-priority", "6"
    assert (
        called("keys", "add", "small", "--role", "submitter", *limits, "--keys", ring).status == 0
    )
    assert called("keys", "add", "large", "--role", "submitter", "--keys", ring).status == 0
    assert called(*AS_THE_GUIDE_SAYS.split(), "--keys", ring).status == 0

    def asking(key: str, kind: str = "move", **goal: Any) -> dict[str, Any]:
        return {"goals": [{"kind": kind, **goal}], "idempotency_key": key, "start_in": 900}

    with stand(tmp_path, "--keys", ring) as there:
        other, own = (("--sign", name, "--keys", ring) for name in ("large", "small"))
        async with agent(there, tmp_path, *other) as large, agent(there, tmp_path, *own) as it:
            tools = {tool.name: tool for tool in (await it.client.list_tools()).tools}
            told = "max_priority 6, max_speed 0.5 m/s, max_distance 2 m, quota 1"
            assert told in (tools["submit"].description or "")
            used = await large.call("submit", **asking("patrol-1", distance=12, speed=1.6))
            for words, asked in {
                "2 m at most in a task, not 12": asking("patrol-1", distance=12, speed=0.2),
                "0.5 m/s at most, not 1.6": asking("patrol-1", distance=1, speed=1.6),
                "2 m at most in a task, not 99": asking("a", "goto", north=99, east=0, speed=0.2),
                "priority 6 at most, not 7": asking("a", distance=1) | {"priority": 7},
                "speed 1e-46 is too small": asking("a", distance=1, speed=1e-46),
            }.items():
                assert words in await it.refused("submit", **asked)
            task = await it.call("submit", **asking("patrol-1", distance=1))
            assert task["id"] != used["id"]
            assert "at most 1 waiting tasks" in await it.refused(
                "submit", **asking("b", distance=1)
            )
            again = await it.call("submit", **asking("patrol-1", distance=1))
            assert again["id"] == task["id"]
            assert "belongs to" in await it.refused("cancel", id=used["id"])


def test_the_limits_of_before_name_the_way_of_now(tmp_path: Path) -> None:
    done = called("mcp", "--max-queued", "5")
    assert done.status == 2
    assert done.error == (
        "mav-tasks: --max-queued: the server keeps the limits of an agent's key: mav-tasks keys"
        " add agent --role submitter --quota 5, then mav-tasks mcp --sign agent\n"
    )


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


class CancelTask(Request[GetParams, Literal["tasks/cancel"]]):
    method: Literal["tasks/cancel"] = "tasks/cancel"
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


@awaited
async def test_a_submission_is_a_task_of_the_protocol_for_who_has_the_extension(
    running: Stand, tmp_path: Path
) -> None:
    tasks = Tasks()
    async with agent(running, tmp_path, extensions=[tasks]) as it:
        goals = {"goals": [MOVE], "idempotency_key": "durable"}
        for _ in range(2):
            await it.client.call_tool("submit", goals)
        first, again = tasks.created
        assert (first.task_id, first.ttl_ms) == (again.task_id, None)
        done = await shown(it, first.task_id, until=("completed", "failed", "cancelled"))
        assert done.status == "completed"
        assert done.result is not None
        assert done.result["structuredContent"]["state"] == "completed"
        assert not done.result["isError"]
        with pytest.raises(MCPError, match="no task '1-1-1'"):
            await shown(it, "1-1-1", until=())

        await it.client.call_tool("submit", goals | {"idempotency_key": "durable 2", "start_in": 9})
        params = GetParams(task_id=tasks.created[-1].task_id)
        await it.client.session.send_request(CancelTask(params=params), Empty)
        await shown(it, params.task_id, until=("cancelled",))
        await it.client.session.send_request(CancelTask(params=params), Empty)  # it is over


async def accepted(request: Callable[[], Awaitable[None]]) -> None:
    """Send a request until the server no longer doubts its order, 4 s after it stood still."""
    for _ in range(100):
        try:
            return await request()
        except MCPError as refused:
            if "delayed by the server" not in str(refused):
                raise
            await asyncio.sleep(0.1)
    raise AssertionError("not accepted")


@awaited
async def test_a_held_task_requires_input(running: Stand, tmp_path: Path) -> None:
    tasks = Tasks()
    async with agent(running, tmp_path, extensions=[tasks]) as it:
        move = {"kind": "move", "distance": 1.5}
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
        assert (await it.call("task", id=number))["state"] == "held"
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


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Host": "evil.example"}, 421),
        ({"Host": "127.0.0.1.evil.example:{port}"}, 421),
        ({"Host": "127.0.0.1:{port}", "Origin": "http://evil.example"}, 403),
        ({"Host": "127.0.0.1:{port}"}, 200),
    ],
)
@pytest.mark.parametrize("version", ["2026-07-28", "2025-11-25"])
def test_a_page_from_elsewhere_cannot_use_it(
    over_http: str, headers: dict[str, str], status: int, version: str
) -> None:
    found = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/mcp", over_http)
    assert found is not None
    port = int(found[1])
    info = {"name": "a", "version": "1"}
    legacy = {"protocolVersion": version, "capabilities": {}, "clientInfo": info}
    meta = {
        "io.modelcontextprotocol/protocolVersion": version,
        "io.modelcontextprotocol/clientInfo": info,
        "io.modelcontextprotocol/clientCapabilities": {},
    }
    is_legacy = version.startswith("2025")
    method = "initialize" if is_legacy else "tools/list"
    params = legacy if is_legacy else {"_meta": meta}
    body = json.dumps({"jsonrpc": "2.0", "id": 1, "method": method, "params": params})
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    connection.request(
        "POST",
        "/mcp",
        body,
        {
            "Content-Type": "application/json",
            "Accept": "application/json, text/event-stream",
            "MCP-Protocol-Version": version,
            "Mcp-Method": method,
            **{name: value.format(port=port) for name, value in headers.items()},
        },
    )
    answer = connection.getresponse()
    text = answer.read()
    connection.close()
    assert answer.status == status, text


def test_other_machines_are_refused_and_a_port_in_use_is_named(over_http: str) -> None:
    beyond = called("mcp", "--http", "0.0.0.0:8765")
    assert beyond.status == 2
    assert beyond.error.startswith("mav-tasks: --http 0.0.0.0:8765: 0.0.0.0 can be reached from")
    place = over_http.removeprefix("http://").removesuffix("/mcp")
    in_use = called("mcp", "--http", place)
    assert (in_use.status, in_use.error) == (
        2,
        (
            f"mav-tasks: --http {place}: Address already in use: end the program that has it"
            " (ss -lntup names it), or choose another\n"
        ),
    )


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
    info = {"name": "a", "version": "1"}
    begin = {"protocolVersion": "2025-11-25", "capabilities": {}, "clientInfo": info}
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
