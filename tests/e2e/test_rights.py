"""Who may do what, on every surface: MAVLink, command line, HTTP, and tools of agents.

Each role sends each of REQUESTS on each surface to one real server. The server decides, so the
answers must be the same, and what was refused must not move the rover.
"""

import asyncio
import json
import time
from collections.abc import Callable, Iterator
from contextlib import AsyncExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
from pymavlink import mavutil

pytest.importorskip("mcp", reason="the MCP SDK is missing: pip install 'mav-tasks[mcp]'")

from tests.kit.agents import Agent, agent
from tests.kit.awaited import awaited
from tests.kit.commands import Done, called
from tests.kit.processes import Stand, stand
from tests.kit.web import Web, add_key, ring_of, web

pytestmark = pytest.mark.slow

ROLES = ("observer", "submitter", "operator", "safety")
#: limits of a submitter
LIMITS = {"max_priority": 6, "max_speed": 1, "max_distance": 20, "quota": 3}
HOME = (-35.363262, 149.165237)
MOVE, STOP, CANCEL, CLEAR, MODIFY, RELEASE = 54000, 54003, 54010, 54011, 54012, 54013
PAUSE_CONTINUE = 193
PRIORITY, PREEMPTIVE, EVERY = 1, 6, 9  # TASK_PROPERTY
SERVER = 250, 191
PIECE = 50  # characters of a STATUSTEXT
ACCEPTED = ""


@dataclass(frozen=True)
class Request:
    """One request; ``refused``: by role, the words of the server that refuses it."""

    name: str
    operation: str
    content: dict[str, Any] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    #: surfaces on which it cannot be said, with the reason
    missing: dict[str, str] = field(default_factory=dict)


def for_all_below(role: str, words: str) -> dict[str, str]:
    """Return the words that refuse a request to each role below one."""
    return {each: f"role {each} {words}" for each in ROLES[: ROLES.index(role)]}


SUBMITS = for_all_below("submitter", "may not")
PLANS = {"mcp": "its goals are drives and waits only"}
NO_ROVER = "no rover can: rover 1: STOP in force"
OTHERS = {"observer": "role observer may not send TASK_"}
REQUESTS = [
    Request("a move", "submit", {"distance": 0.2}, SUBMITS),
    Request(
        "priority",
        "submit",
        {"distance": 0.2, "priority": 9},
        SUBMITS | {"submitter": "role submitter may use priority 6 at most, not 9"},
    ),
    Request(
        "speed",
        "submit",
        {"distance": 0.2, "speed": 2.0},
        SUBMITS | {"submitter": "role submitter may drive 1 m/s at most, not 2"},
    ),
    Request(
        "distance",
        "submit",
        {"distance": 30.0},
        SUBMITS | {"submitter": "role submitter may drive 20 m"},
    ),
    Request(
        "a servo in a plan",
        "plan",
        {"servo": True},
        SUBMITS | {"submitter": "role submitter may not send a plan that contains rover commands"},
        PLANS,
    ),
    Request(
        "a series", "submit", {"distance": 0.25, "every": 3600}, SUBMITS, {"mcp": "no argument"}
    ),
    Request(
        "one too many",
        "submit",
        {"distance": 0.4},
        SUBMITS | {"submitter": "role submitter may have at most 3 waiting tasks"},
        {"mcp": "it has one task fewer, without the series"},
    ),
    Request(
        "any rover, too fast",
        "submit",
        {"distance": 0.2, "is_any": True, "speed": 1.5},
        SUBMITS
        | {
            "submitter": "role submitter may drive 1 m/s at most, not 1.5",
            "operator": NO_ROVER,
            "safety": NO_ROVER,
        },
        {"mcp": "limits are looked up by rover"},
    ),
    Request(
        "pre-emption",
        "modify own",
        {"preemptive": True},
        for_all_below("operator", "may not make a task pre-emptive")
        | {"observer": "role observer may not"},
        {"mcp": "no tool"},
    ),
    Request(
        "another's priority",
        "modify other's",
        {"priority": 3},
        OTHERS | {"submitter": "role submitter may not modify: task"},
        {"mcp": "no tool"},
    ),
    Request(
        "another's held task",
        "release other's",
        {},
        OTHERS
        | {"submitter": "role submitter may not release: task"}
        | dict.fromkeys(("operator", "safety"), "is not held, it is queued"),
    ),
    Request(
        "another's task",
        "cancel other's",
        {},
        OTHERS | {"submitter": "role submitter may not cancel: task"},
    ),
    Request("clear", "clear", {}, for_all_below("operator", "may not"), {"mcp": "no tool"}),
    Request("the fence", "fence", {}, for_all_below("safety", "may not"), {"mcp": "no tool"}),
    Request(
        "resume",
        "resume",
        {},
        for_all_below("operator", "may not send DO_PAUSE_CONTINUE; operator may"),
    ),
    Request("pause", "pause"),
    Request("stop", "stop"),
]


class Mavlink:
    """Stock pymavlink, which signs. As on each surface, a method returns why it was refused."""

    def __init__(self, it: Stand, secret: str, number: int) -> None:
        url = f"udpout:127.0.0.1:{it.client_port}"
        self._link = mavutil.mavlink_connection(url, source_system=240, source_component=number)
        self._link.setup_signing(
            bytes.fromhex(secret),
            sign_outgoing=True,
            allow_unsigned_callback=lambda *_: True,
            link_id=number,
        )
        self._link.port.connect(("127.0.0.1", it.client_port))  # no other server is heard
        self._link.mav.heartbeat_send(6, 8, 0, 0, 4)
        assert self._link.wait_heartbeat(timeout=10) is not None, "no heartbeat"
        self._texts, self._told = Texts(), 0

    def close(self) -> None:
        self._link.close()

    async def submit(
        self,
        *,
        distance: float = 0.0,
        speed: float = 0.0,
        priority: float = float("nan"),
        every: int = 0,
        is_any: bool = False,
    ) -> str:
        if is_any:
            self._catch_up()
            terms = (float("nan"), 0, 0, priority)  # no nonce: it shows that it knows the dialect
            self._link.mav.command_long_send(*SERVER, MOVE, 0, distance, speed, 0, *terms)
            return self._answer(MOVE)[1]
        task, words = self._command(MOVE, distance, speed, 0, 0, 0, 0, priority)
        return words or (self._command(MODIFY, task, EVERY, every)[1] if every else "")

    async def plan(self, **_content: Any) -> str:
        return self._upload(0, [(16, 0, 0, 0, 0), (183, 1, 1500, 0, 0)])

    async def modify(self, task: int, *, preemptive: bool = False, priority: int = 0) -> str:
        what = (PREEMPTIVE, 1) if preemptive else (PRIORITY, priority)
        return self._command(MODIFY, task, *what)[1]

    async def release(self, task: int) -> str:
        return self._command(RELEASE, task, 2)[1]

    async def cancel(self, task: int) -> str:
        return self._command(CANCEL, task)[1]

    async def clear(self) -> str:
        return self._command(CLEAR)[1]

    async def fence(self) -> str:
        return self._upload(1, [(5003, 500, 0, 0, 0)])

    async def resume(self) -> str:
        return self._command(PAUSE_CONTINUE, 1)[1]

    async def pause(self) -> str:
        return self._command(PAUSE_CONTINUE, 0)[1]

    async def stop(self) -> str:
        return self._command(STOP)[1]

    def _command(self, number: int, *params: float) -> tuple[int, str]:
        filled = (*params, *(0.0,) * (7 - len(params)))
        self._catch_up()
        self._link.mav.command_long_send(1, 191, number, 0, *filled)
        return self._answer(number)

    def _answer(self, command: int) -> tuple[int, str]:
        """Return result_param2 and, of a refusal, its text."""
        ack = self._until(lambda each: each.get_type() == "COMMAND_ACK" and each.command == command)
        return (ack.result_param2, "") if ack.result == 0 else (0, self._words())

    def _upload(self, mission_type: int, items: list[tuple[float, ...]]) -> str:
        """Upload a plan; return the words of its refusal."""
        x, y = (round(each * 1e7) for each in HOME)

        def is_ack(message: Any) -> bool:
            if message.get_type() in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
                command, *params = items[message.seq]
                item = (1, 1, message.seq, 6, command, 0, 1, *params, x, y, 0, mission_type)
                self._link.mav.mission_item_int_send(*item)
            return bool(message.get_type() == "MISSION_ACK")

        self._catch_up()
        self._link.mav.mission_count_send(1, 1, len(items), mission_type)
        return "" if self._until(is_ack).type == 0 else self._words()

    def _catch_up(self) -> None:
        """Read what has come: a buffer full of telemetry would have no room for an answer."""
        while (message := self._link.recv_match()) is not None:
            self._note(message)

    def _until(self, is_it: Callable[[Any], bool], *, within: float = 5.0) -> Any:
        """Return the first message of a kind, None if none comes; note texts on the way."""
        until = time.monotonic() + within
        while time.monotonic() < until:
            message = self._link.recv_match(blocking=True, timeout=0.1)
            if message is None:
                continue
            self._note(message)
            if is_it(message):
                return message
        return None

    def _note(self, message: Any) -> None:
        if message.get_type() == "STATUSTEXT":
            self._texts.take(message)

    def _words(self) -> str:
        """Return the text of a refusal, which follows it. The same text is not sent twice."""
        if self._texts.count == self._told:
            self._until(lambda _: self._texts.count > self._told, within=0.3)
        self._told = self._texts.count
        return self._texts.last


class Texts:
    """The server's words of refusal, of which long ones come in pieces."""

    def __init__(self) -> None:
        self.last, self.count = "", 0
        self._pieces: dict[int, str] = {}

    def take(self, message: Any) -> None:
        """Take a STATUSTEXT."""
        text = self._pieces.pop(message.id, "") + message.text
        if message.id and len(message.text) == PIECE:
            self._pieces[message.id] = text
        elif text.startswith(("role ", "no rover", "task ")):
            self.last, self.count = text, self.count + 1


class CommandLine:
    """``mav-tasks``, with a key of the ring."""

    def __init__(self, it: Stand, folder: Path, key: str) -> None:
        self._server = f"udpout:127.0.0.1:{it.client_port}"
        self._key = ("--sign", key, "--keys", str(ring_of(folder)))
        self._plan, self._fence = folder / "servo.waypoints", folder / "fence.plan"
        place = f"{HOME[0]}\t{HOME[1]}"
        self._plan.write_text(
            f"QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t{place}\t584\t1\n"
            f"1\t0\t3\t16\t0\t0\t0\t0\t{place}\t0\t1\n2\t0\t3\t183\t1\t1500\t0\t0\t0\t0\t0\t1\n"
        )
        self._fence.write_text(json.dumps(FENCE))

    async def submit(
        self,
        *,
        distance: float = 0.0,
        is_any: bool = False,
        **options: Any,
    ) -> str:
        what = ["move", str(distance), *(["--vehicle", "any"] if is_any else [])]
        named = {"speed", "priority", "every"} & options.keys()
        each = [(f"--{name}", f"{options[name]}" + "s" * (name == "every")) for name in named]
        return await self._run("submit", *what, *(part for pair in each for part in pair))

    async def plan(self, **_content: Any) -> str:
        return await self._run("mission", "upload", str(self._plan))

    async def modify(self, task: int, *, preemptive: bool = False, priority: int = 0) -> str:
        what = ["--preemptive"] if preemptive else ["--priority", str(priority)]
        return await self._run("modify", str(task), *what)

    async def release(self, task: int) -> str:
        return await self._run("release", str(task), "skip")

    async def cancel(self, task: int) -> str:
        return await self._run("cancel", str(task))

    async def clear(self) -> str:
        return await self._run("clear")

    async def fence(self) -> str:
        return await self._run("fence", "upload", str(self._fence))

    async def resume(self) -> str:
        return await self._run("resume")

    async def pause(self) -> str:
        return await self._run("pause")

    async def stop(self) -> str:
        return await self._run("stop")

    async def _run(self, *arguments: str) -> str:
        # in a thread: a command has an event loop of its own
        done = await asyncio.to_thread(called, *arguments, *self._key, server=self._server)
        assert done.status in (0, 1, 2), done
        return done.error.strip() if done.status else ""


class Http:
    """The API of ``mav-tasks web``, with the secret of a key as the token."""

    def __init__(self, page: Web, secret: str) -> None:
        bearer = {"authorization": f"Bearer {secret}"}
        self.client = httpx.Client(base_url=page.url, timeout=15, headers=bearer)

    async def submit(
        self,
        *,
        distance: float = 0.0,
        speed: float | None = None,
        is_any: bool = False,
        **terms: Any,
    ) -> str:
        goal: dict[str, Any] = {"kind": "move", "distance": distance}
        goal |= {} if speed is None else {"speed": speed}
        rover = "any" if is_any else "1"
        return self._send("POST", f"/vehicles/{rover}/tasks", {"goals": [goal], **terms})

    async def plan(self, **_content: Any) -> str:
        x, y = HOME
        servo = {"command": 183, "params": [1, 1500, 0, 0, 0, 0, 0]}
        way = {"command": 16, "params": [0, 0, 0, None, x, y, 0]}
        items = [
            {"type": "SimpleItem", "autoContinue": True, "frame": 3, **e} for e in (way, servo)
        ]
        for number, each in enumerate(items):
            each["doJumpId"] = number + 1
        plan = {**FENCE, "mission": {**FENCE["mission"], "items": items}}
        return self._send(
            "POST", "/vehicles/1/missions", {"name": "servo.plan", "text": json.dumps(plan)}
        )

    async def modify(self, task: int, **content: Any) -> str:
        return self._send("PATCH", f"/tasks/{task}", content)

    async def release(self, task: int) -> str:
        return self._send("POST", f"/tasks/{task}/release", {"how": "skip", "epoch": self._epoch()})

    async def cancel(self, task: int) -> str:
        return self._send("POST", f"/tasks/{task}/cancel", {})

    async def clear(self) -> str:
        return self._send("POST", "/vehicles/1/clear", {})

    async def fence(self) -> str:
        return self._send(
            "PUT", "/vehicles/1/fence", {"name": "yard.plan", "text": json.dumps(FENCE)}
        )

    async def resume(self) -> str:
        return self._send("POST", "/vehicles/1/resume", {"epoch": self._epoch()})

    async def pause(self) -> str:
        return self._send("POST", "/vehicles/1/pause", {})

    async def stop(self) -> str:
        return self._send("POST", "/stop", {})

    def _epoch(self) -> int:
        return int(self.client.get("/api/v1/vehicles/1/queue").json()["halt_epoch"])

    def _send(self, method: str, path: str, body: Any) -> str:
        answer = self.client.request(method, f"/api/v1{path}", json=body)
        if answer.is_success:
            return ""
        assert answer.status_code in (403, 409, 429), answer.text
        return str(answer.json()["detail"])


class Tools:
    """The tools of ``mav-tasks mcp``, with a key of the ring."""

    def __init__(self, it: Agent) -> None:
        self._agent = it

    async def submit(self, *, distance: float, speed: float = 0.0, **terms: Any) -> str:
        goal = {"kind": "move", "distance": distance} | ({"speed": speed} if speed else {})
        key = f"{time.monotonic_ns()}"
        return await self._call("submit", goals=[goal], idempotency_key=key, **terms)

    async def plan(self, **_content: Any) -> str:
        raise NotImplementedError

    async def modify(self, task: int, **content: Any) -> str:
        raise NotImplementedError

    async def release(self, task: int) -> str:
        return await self._call("release", id=task, how="skip", epoch=await self._epoch())

    async def cancel(self, task: int) -> str:
        return await self._call("cancel", id=task)

    async def clear(self) -> str:
        raise NotImplementedError

    async def fence(self) -> str:
        raise NotImplementedError

    async def resume(self) -> str:
        return await self._call("resume", epoch=await self._epoch())

    async def pause(self) -> str:
        return await self._call("pause")

    async def stop(self) -> str:
        return await self._call("stop")

    async def _epoch(self) -> int:
        return int((await self._agent.call("queue"))["halt_epoch"])

    async def _call(self, tool: str, **arguments: Any) -> str:
        done = await self._agent.client.call_tool(tool, arguments)
        if not done.is_error:
            return ""
        (content,) = done.content
        assert content.type == "text"
        return content.text


FENCE: dict[str, Any] = {
    "fileType": "Plan",
    "geoFence": {
        "circles": [
            {
                "circle": {"center": list(HOME), "radius": 500},
                "inclusion": True,
                "version": 1,
            }
        ],
        "polygons": [],
        "version": 2,
    },
    "groundStation": "QGroundControl",
    "mission": {
        "cruiseSpeed": 15,
        "firmwareType": 3,
        "hoverSpeed": 5,
        "items": [],
        "plannedHomePosition": [*HOME, 584],
        "vehicleType": 10,
        "version": 2,
    },
    "rallyPoints": {"points": [], "version": 2},
    "version": 1,
}


@dataclass
class Everything:
    """A server with a key for each role, and its web process."""

    stand: Stand
    page: Web
    folder: Path
    secrets: dict[str, str]

    async def safety(self, *arguments: str) -> None:
        """Run a command as the person in charge of safety."""
        await self.run("safety", *arguments)

    async def task_of(self, role: str) -> int:
        """Return a new task that waits; an observer has none, and so gets another's."""
        who = "safety" if role == "observer" else role
        done = await self.run(who, "submit", "wait", "1h", "--json")
        return int(done.objects[0]["id"])

    async def run(self, role: str, *arguments: str) -> Done:
        """Run a command with a role's key."""
        ring = ("--sign", role, "--keys", str(ring_of(self.folder)))
        url = f"udpout:127.0.0.1:{self.stand.client_port}"
        done = await asyncio.to_thread(called, *arguments, *ring, server=url)
        assert done.status == 0, done
        return done

    def place(self) -> tuple[float, float]:
        """Return the rover's true place, m."""
        last = self.stand.truth()[-1]
        return last["north"], last["east"]


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Everything]:
    folder = tmp_path_factory.mktemp("rights")
    ring = ("--keys", str(ring_of(folder)))
    secrets = {role: add_key(folder, role, role) for role in ROLES}
    limits = [f"roles.submitter.{name}={value}" for name, value in LIMITS.items()]
    options = [part for each in limits for part in ("--set", each)]
    with (
        stand(folder, *ring, *options, client_options="?unsigned=refuse") as it,
        web(folder, it, "--sign", "observer", *ring) as page,
    ):
        yield Everything(it, page, folder, secrets)


SURFACES = ("mavlink", "command line", "http", "mcp")


@pytest.mark.parametrize("role", ROLES)
@awaited
async def test_each_surface_gives_each_role_the_same_answer(
    everything: Everything, role: str
) -> None:
    it = everything
    began = it.place()
    answers: dict[str, dict[str, str]] = {}
    async with AsyncExitStack() as stack:
        ring = ("--sign", role, "--keys", str(ring_of(it.folder)))
        tools = await stack.enter_async_context(agent(it.stand, it.folder, *ring))
        mavlink = Mavlink(it.stand, it.secrets[role], 1 + ROLES.index(role))
        stack.callback(mavlink.close)
        http = Http(it.page, it.secrets[role])
        stack.callback(http.client.close)
        surfaces: dict[str, Any] = {
            "mavlink": mavlink,
            "command line": CommandLine(it.stand, it.folder, role),
            "http": http,
            "mcp": Tools(tools),
        }
        for name, surface in surfaces.items():
            await it.safety("stop")  # nothing begins
            others, own = [await it.task_of(who) for who in ("safety", role)]
            for request in REQUESTS:
                if name in request.missing:
                    continue
                operation, _, whose = request.operation.partition(" ")
                ask: Callable[..., Any] = getattr(surface, operation)
                on = {"own": [own], "other's": [others]}.get(whose, [])
                await asyncio.sleep(0.1)  # a client gets so many texts a second
                answers.setdefault(request.name, {})[name] = await ask(*on, **request.content)
            await it.safety("clear", "--all", "--yes")
    wrong = []
    for request in REQUESTS:
        expected = request.refused.get(role, ACCEPTED)
        for name, said in answers[request.name].items():
            if expected not in said or (said and not expected):
                wrong.append((request.name, name, said, expected))
    assert wrong == []
    assert it.place() == began, "the rover moved"
