"""Who may do what, on every surface: command line, HTTP, and tools of agents.

Each role sends each of REQUESTS on each surface to one real server. The server decides, so the
answers must be the same, and what was refused must not move the rover.
``scenarios/test_roles.py`` has all that a role may do.
"""

import asyncio
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mcp", reason="the MCP SDK is missing: pip install 'mav-tasks[mcp]'")

from tests.kit.agents import Agent, agent, url_of
from tests.kit.awaited import awaited
from tests.kit.commands import called
from tests.kit.processes import Stand, stand
from tests.kit.web import Web, add_key, ring_of, web

pytestmark = pytest.mark.slow

ROLES = ("observer", "submitter", "operator", "safety")
OBSERVER = {"observer": "role observer may not"}
NO_RESUME = "may not send DO_PAUSE_CONTINUE; operator may"
#: request, and the words of the server to those whom it refuses it
REQUESTS: tuple[tuple[str, dict[str, float], dict[str, str]], ...] = (
    ("submit", {"distance": 0.2}, OBSERVER),
    (
        "submit",
        {"distance": 0.2, "speed": 2.0},
        OBSERVER | {"submitter": "role submitter may drive 1 m/s at most, not 2"},
    ),
    (
        "submit",
        {"distance": 0.2, "priority": 9},
        OBSERVER | {"submitter": "role submitter may use priority 6 at most, not 9"},
    ),
    ("cancel", {}, OBSERVER | {"submitter": "role submitter may not cancel: task"}),
    ("resume", {}, {role: f"role {role} {NO_RESUME}" for role in ("observer", "submitter")}),
    ("pause", {}, {}),
    ("stop", {}, {}),
)


class CommandLine:
    """``mav-tasks``, with a key of the ring. As on each surface: ask returns why it is refused."""

    def __init__(self, it: "Everything", role: str) -> None:
        self._more = ("--sign", role, "--keys", str(ring_of(it.folder)))
        self._server = url_of(it.stand)

    async def ask(self, what: str, task: int, terms: dict[str, float]) -> str:
        words = {"submit": ["move", f"{terms.get('distance')}"], "cancel": [f"{task}"]}.get(what)
        options = [f"--{name}={value:g}" for name, value in terms.items() if name != "distance"]
        done = await asyncio.to_thread(  # a command has an event loop of its own
            called, what, *(words or ()), *options, *self._more, server=self._server
        )
        assert done.status in (0, 1, 2), done
        return done.error if done.status else ""


class Http:
    """The API of ``mav-tasks web``, with the secret of a key as the token."""

    def __init__(self, it: "Everything", role: str) -> None:
        self._page, self._bearer = it.page, it.bearer(role)

    async def ask(self, what: str, task: int, terms: dict[str, float]) -> str:
        goal = {"kind": "move"} | {n: v for n, v in terms.items() if n != "priority"}
        queue = self._page.get("/vehicles/1/queue", headers=self._bearer)
        requests: dict[str, tuple[str, dict[str, Any]]] = {
            "submit": ("/vehicles/1/tasks", {"goals": [goal]}),
            "cancel": (f"/tasks/{task}/cancel", {}),
            "resume": ("/vehicles/1/resume", {"epoch": queue["halt_epoch"]}),
            "pause": ("/vehicles/1/pause", {}),
            "stop": ("/stop", {}),
        }
        path, body = requests[what]
        body |= {name: value for name, value in terms.items() if name == "priority"}
        answer = self._page.send("POST", path, body, **self._bearer)
        return "" if answer.is_success else str(answer.json()["detail"])


class Tools:
    """The tools of ``mav-tasks mcp``, with a key of the ring."""

    def __init__(self, it: Agent) -> None:
        self._agent = it

    async def ask(self, what: str, task: int, terms: dict[str, float]) -> str:
        goal = {"kind": "move"} | {n: v for n, v in terms.items() if n != "priority"}
        requests: dict[str, dict[str, Any]] = {
            "submit": {"goals": [goal], "idempotency_key": f"{time.monotonic_ns()}"},
            "cancel": {"id": task},
            "resume": {"epoch": (await self._agent.call("queue"))["halt_epoch"]},
        }
        arguments = requests.get(what, {})
        arguments |= {name: value for name, value in terms.items() if name == "priority"}
        done = await self._agent.client.call_tool(what, arguments)
        return str(done.content) if done.is_error else ""


@dataclass
class Everything:
    """A server with a key for each role, and its web process."""

    stand: Stand
    page: Web
    folder: Path
    secrets: dict[str, str]

    def bearer(self, role: str) -> dict[str, str]:
        """Return the header of a role's requests by HTTP."""
        return {"authorization": f"Bearer {self.secrets[role]}"}

    @asynccontextmanager
    async def surfaces(self, role: str) -> AsyncIterator[dict[str, Any]]:
        """Yield the surfaces, as one with this role uses them."""
        ring = ("--sign", role, "--keys", str(ring_of(self.folder)))
        async with agent(self.stand, self.folder, *ring) as tools:
            yield {
                "command line": CommandLine(self, role),
                "http": Http(self, role),
                "mcp": Tools(tools),
            }


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Everything]:
    folder = tmp_path_factory.mktemp("rights")
    ring = ("--keys", str(ring_of(folder)))
    secrets = {role: add_key(folder, role, role) for role in ROLES}
    limits = [f"--set=roles.submitter.{each}" for each in ("max_priority=6", "max_speed=1")]
    with (
        stand(folder, *ring, *limits, client_options="?unsigned=refuse") as it,
        web(folder, it, "--sign", "observer", *ring) as page,
    ):
        yield Everything(it, page, folder, secrets)


@pytest.mark.parametrize("role", ROLES)
@awaited
async def test_each_surface_gives_each_role_the_same_answer(
    everything: Everything, role: str
) -> None:
    it = everything
    safety = CommandLine(it, "safety")
    began = it.stand.truth()[-1]
    wrong = []
    async with it.surfaces(role) as surfaces:
        for name, surface in surfaces.items():
            await safety.ask("stop", 0, {})  # nothing begins
            await safety.ask("submit", 0, {"distance": 1.0})
            queue = it.page.get("/vehicles/1/queue", headers=it.bearer("safety"))
            task = queue["waiting"][-1]["id"]
            for what, terms, refused in REQUESTS:
                if what == "resume":
                    await safety.ask("clear", 0, {})
                said, expected = await surface.ask(what, task, terms), refused.get(role, "")
                if expected not in said or (said and not expected):
                    wrong.append((what, terms, name, said, expected))
    assert wrong == []
    there = it.stand.truth()[-1]
    assert (there["north"], there["east"]) == (began["north"], began["east"])
