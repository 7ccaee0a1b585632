"""A running web process beside a server and a rover, and a client of its API."""

import json
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx

from mav_tasks import Key
from tests.kit.commands import called
from tests.kit.processes import Process, Stand, process, stand, wait_until


@dataclass
class Web:
    """A web process: its address, and the client of a program without a token."""

    process: Process
    url: str
    client: httpx.Client

    def get(self, path: str, **named: Any) -> Any:
        """Return the JSON at an address of the API; fail if it is a problem."""
        answer = self.client.get(f"/api/v1{path}", **named)
        assert answer.is_success, answer.text
        return answer.json()

    def send(self, method: str, path: str, body: Any, **headers: str) -> httpx.Response:
        """Send JSON; return the answer, whatever it is."""
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        return self.client.request(method, f"/api/v1{path}", json=body, headers=named)

    def post(self, path: str, body: Any, **headers: str) -> Any:
        """Send JSON by POST; return the answer's JSON, None if it has none."""
        answer = self.send("POST", path, body, **headers)
        assert answer.is_success, answer.text
        return answer.json() if answer.content else None

    def resume(self, rover: int = 1) -> None:
        """Let a rover's tasks run.

        Each copy of a halt counts as a halt. On a busy machine the server may take the web client's
        copy of a pause or STOP just after this has read the epoch: then read it again.
        """
        for _ in range(3):
            epoch = self.get(f"/vehicles/{rover}/queue")["halt_epoch"]
            answer = self.send("POST", f"/vehicles/{rover}/resume", {"epoch": epoch})
            if answer.is_success or answer.json()["reason"] != "stale":
                break
        assert answer.is_success, answer.text

    def empty(self) -> None:
        """Cancel the tasks of rover 1, and let it run new ones."""
        self.post("/stop", {"clear": True})

        def is_empty() -> bool:
            queue = self.get("/vehicles/1/queue")
            return not queue["running"] and not queue["waiting_count"]

        wait_until(is_empty, within=15, what="an empty queue")
        self.resume()

    def task(self, task_id: int) -> Any:
        """Return a task."""
        return self.get(f"/tasks/{task_id}")

    def wait_for(self, task_id: int, *states: str, within: float = 30.0) -> Any:
        """Wait until a task is in one of the states; return it."""

        def found() -> Any:
            task = self.task(task_id)
            return task if task["state"] in states else None

        return wait_until(found, within=within, what=lambda: f"{states} of {self.task(task_id)}")

    def events(self, *, last: str = "") -> Iterator[tuple[str, str, Any]]:
        """Yield events of the stream: kind, id ("" for none) and data."""
        headers = {"last-event-id": last} if last else {}
        with self.client.stream("GET", "/api/v1/events", headers=headers, timeout=30) as stream:
            assert stream.status_code == 200
            kind = number = ""
            for line in stream.iter_lines():
                name, _, value = line.partition(": ")
                if name == "event":
                    kind = value
                elif name == "id":
                    number = value
                elif name == "data":
                    yield kind, number, json.loads(value)
                    kind = number = ""


@contextmanager
def web(
    folder: Path, it: Stand, *options: str, server: str = "", name: str = "web"
) -> Iterator[Web]:
    """Run a web process for a ``with`` block, on a free port of the loopback.

    Its key ring is that of a server in the same folder.
    """
    command = ["-m", "mav_tasks.cli", "web", "--listen", "127.0.0.1:0", "--store", ""]
    command += ["--server", server or f"udpout:127.0.0.1:{it.client_port}"]
    command += options
    with process(*command, folder=folder, name=name) as running:
        url = running.wait_for(r"web page: (http://\S+)/\n")[1]
        with httpx.Client(base_url=url, timeout=45) as client:
            yield Web(running, url, client)


@contextmanager
def served(folder: Path) -> Iterator[tuple[Stand, Web]]:
    """Run a server, a rover and a web process that shows it, with one store, for a block."""
    store = str(folder / "tasks.sqlite3")
    with (
        # other tests keep the disk busy
        stand(folder, "--set", "watch.commit=5", serve_store=store) as it,
        web(folder, it, "--store", store) as page,
    ):
        has_rover(page)
        yield it, page


def add_key(folder: Path, name: str, role: str) -> str:
    """Add a key to the ring of the processes in a folder; return its token."""
    ring = ring_of(folder)
    ring.parent.mkdir(mode=0o700, exist_ok=True)
    done = called("keys", "add", name, "--role", role, "--keys", str(ring))
    assert done.status == 0, done.error
    return done.output.strip()


def key_in(ring: Path, name: str) -> Key:
    """Return a key of a ring."""
    entry = tomllib.loads(ring.read_text(encoding="utf-8"))["keys"][name]
    return Key(name, bytes.fromhex(entry["secret"]), entry["role"])


def ring_of(folder: Path) -> Path:
    """Return the key ring of the processes in a folder."""
    return folder / "mav-tasks" / "keys.toml"


def has_rover(it: Web) -> Any:
    """Wait until the page shows a rover with a position and a queue; return it."""

    def found() -> Any:
        _, _, shown = next(it.events())
        rovers = shown["vehicles"] if shown["queues"] else []
        return rovers[0] if rovers and rovers[0]["north"] is not None else None

    return wait_until(found, within=20, what="a rover with a position and a queue")
