"""``python -m tests.kit.agent_crashes URL CRASHES SEED``: agents that are killed while they submit.

Each life of the agent is a process of its own, ``mav-tasks mcp`` on pipes, with its own sockets. It
is forked from this one, which has imported the code already: 1,000 starts of Python would take
longer than the crashes. A life submits a task and is killed (SIGKILL) at a random moment of that;
the next life asks again with the same key, and is sometimes killed at that, too.

Prints one line of JSON: by key the ids that agents were told, and when the kills came.
"""

import json
import os
import select
import signal
import sys
import time
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from random import Random
from statistics import median
from typing import Any

from mav_tasks.agents import server, stdio, streamable_http
from mav_tasks.cli import mcp as command
from mav_tasks.cli.app import main
from mav_tasks.client import aio
from mav_tasks.client.idempotency import numbers_of

WARM = (server, stdio, streamable_http, command, aio)  # imported before the first fork
META = {
    "io.modelcontextprotocol/protocolVersion": "2026-07-28",
    "io.modelcontextprotocol/clientInfo": {"name": "crashing", "version": "1"},
    "io.modelcontextprotocol/clientCapabilities": {},
}
LONGEST = 30.0  # s for an answer
#: kills come within so many times the usual time of a submission
SPREAD = 1.6
CALM = 9  # the last submissions without a crash, which measure that time
KILLED_AGAIN = 0.3  # of the lives that ask again
MANY = 40  # waiting tasks, beyond which the next submission waits
STEP = 0.02  # m, there and back


class Gone(Exception):
    """The agent's process has ended."""


class Life:
    """One process of the agent."""

    def __init__(self, url: str) -> None:
        given, self._to = os.pipe()
        self._from, made = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            os.close(self._to)
            os.close(self._from)
            self._become(url, given, made)
        os.close(given)
        os.close(made)
        self._unread = b""
        self._asked = 0

    @staticmethod
    def _become(url: str, given: int, made: int) -> None:
        try:
            os.dup2(given, 0)
            os.dup2(made, 1)
            main(["mcp", "--server", url])
        finally:
            os._exit(1)

    def send(self, tool: str, **arguments: Any) -> int:
        """Send a call; return its number."""
        self._asked += 1
        params = {"name": tool, "arguments": arguments, "_meta": META}
        call = {"jsonrpc": "2.0", "id": self._asked, "method": "tools/call", "params": params}
        os.write(self._to, json.dumps(call).encode() + b"\n")
        return self._asked

    def answer(self, number: int, *, within: float = LONGEST) -> dict[str, Any]:
        """Return the result of a call. Raise Gone if the process ended, or TimeoutError."""
        end = time.monotonic() + within
        while True:
            line, found, rest = self._unread.partition(b"\n")
            if found:
                self._unread = rest
                message = json.loads(line)
                if message.get("id") == number:
                    result: dict[str, Any] = message["result"]
                    return result
                continue
            if not select.select([self._from], [], [], max(0.0, end - time.monotonic()))[0]:
                raise TimeoutError(f"call {number}")
            read = os.read(self._from, 65_536)
            if not read:
                raise Gone(f"call {number}")
            self._unread += read

    def call(self, tool: str, **arguments: Any) -> dict[str, Any]:
        """Call a tool that must succeed."""
        result = self.answer(self.send(tool, **arguments))
        assert not result["isError"], result["content"]
        found: dict[str, Any] = result["structuredContent"]
        return found

    def kill(self) -> None:
        """End the process by SIGKILL."""
        os.kill(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)

    def close(self) -> None:
        """Close the pipes of an ended process."""
        os.close(self._to)
        os.close(self._from)


@contextmanager
def living(url: str) -> Iterator[Life]:
    """Yield a life, which ends with the block at the latest."""
    life = Life(url)
    try:
        yield life
    finally:
        with suppress(ProcessLookupError, ChildProcessError):
            life.kill()
        life.close()


class Story:
    """The keys so far, and what agents were told."""

    def __init__(self, url: str, seed: int) -> None:
        self.url = url
        self.random = Random(seed)
        self.told: dict[str, list[int]] = {}
        self.kills: Counter[str] = Counter()
        self._took: deque[float] = deque(maxlen=CALM)  # s that the last submissions took
        self._pending = ""  # key whose submission was interrupted
        self._unheard = ""  # how it was, if nobody was answered

    def begin(self) -> None:
        """Submit some tasks without a crash, each in a life of its own."""
        for _ in range(CALM):
            self._pending = self._new_key()
            self.settle()

    def crash(self) -> None:
        """Live one life, up to its crash; if it is the first with a key, after one that asks again.

        A life submits only once: after a plan a client rests for half a second.
        """
        if self._pending and self.random.random() < KILLED_AGAIN:
            self._live_and_crash("asked again: ")
            return
        self.settle()
        self._pending = self._new_key()
        self._live_and_crash("asked first: ")

    def settle(self) -> None:
        """Ask again for the task whose submission was interrupted."""
        if not self._pending:
            return
        with living(self.url) as life:
            self._note_what_became_of_it(make_room(life))
            began = time.monotonic()
            self.told[self._pending].append(life.call("submit", **wish_of(self._pending))["id"])
            self._took.append(time.monotonic() - began)
        self._pending = ""

    def _live_and_crash(self, which: str) -> None:
        with living(self.url) as life:
            self._note_what_became_of_it(make_room(life))
            self._crash(life, which)

    def _note_what_became_of_it(self, nonces: set[int]) -> None:
        if self._unheard:
            was_there = nonce_of(self._pending) in nonces
            self.kills[f"{self._unheard}{'stored' if was_there else 'not stored'}"] += 1
            self._unheard = ""

    @property
    def usual(self) -> float:
        """How long a submission takes at present, s. The more tasks are over, the longer."""
        return median(self._took)

    def _new_key(self) -> str:
        key = f"key {len(self.told)}"
        self.told[key] = []
        return key

    def _crash(self, life: Life, which: str) -> None:
        number = life.send("submit", **wish_of(self._pending))
        time.sleep(self.random.uniform(0.0, SPREAD * self.usual))
        life.kill()
        try:
            result = life.answer(number, within=1.0)
        except Gone:
            self._unheard = f"{which}no answer, task "
        else:
            self._unheard = ""
            self.told[self._pending].append(result["structuredContent"]["id"])
            self.kills[f"{which}answered"] += 1


def wish_of(key: str) -> dict[str, Any]:
    """Return the content of a key's task, always the same."""
    there = int(key.rpartition(" ")[2]) % 2
    goals = [{"kind": "move", "distance": STEP if there else -STEP}]
    return {"goals": goals, "idempotency_key": key, "label": key}


def nonce_of(key: str) -> int:
    """Return the nonce of a key's task."""
    return numbers_of(key, label="").nonce


def make_room(life: Life) -> set[int]:
    """Wait until few tasks wait; return the nonces of the tasks that exist."""
    while True:
        queue = life.call("queue", limit=100)
        if queue["waiting_count"] < MANY:
            break
        life.call("wait", id=queue["waiting"][0]["id"], seconds=5)
    over = life.call("history", limit=100)["tasks"]
    current = [queue["current"]] if queue["current"] else []
    return {task["nonce"] for task in (*queue["waiting"], *over, *current)}


def run(url: str, crashes: int, seed: int) -> dict[str, Any]:
    """Crash so many times; return what agents were told."""
    story = Story(url, seed)
    story.begin()
    for _ in range(crashes):
        story.crash()
    story.settle()
    return {"told": story.told, "kills": story.kills, "usual": round(story.usual, 4)}


if __name__ == "__main__":
    print(json.dumps(run(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))))
