"""Runs ``mav-tasks`` like an operator or a script."""

import io
import json
import os
import subprocess
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from mav_tasks.cli.app import main
from tests.kit.processes import wait_until

LIMIT = 100.0  # s


@dataclass(frozen=True, slots=True)
class Done:
    """The result of a command."""

    status: int
    output: str
    error: str

    @property
    def lines(self) -> list[str]:
        """Return the lines of its output."""
        return self.output.splitlines()

    @property
    def objects(self) -> list[Any]:
        """Return the JSON objects of its output, one a line."""
        return [json.loads(line) for line in self.lines]


def called(*arguments: str, server: str = "") -> Done:
    """Run a command within this process, which saves the second that a process takes."""
    output, error = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8") for _ in range(2))
    status: object = None
    with redirect_stdout(output), redirect_stderr(error):
        try:
            main([*arguments, *(("--server", server) if server else ())])
        except SystemExit as end:
            status = end.code
    texts = []
    for stream in (output, error):
        stream.seek(0)
        texts.append(stream.read())
    assert isinstance(status, int), status
    return Done(status, *texts)


def session(server: str, text: str) -> None:
    """Run commands, one a line, which must tell what stands behind the arrow.

    That are parts of the exit status, output and errors, with … between them. "queue" runs again
    until it tells that.
    """
    said: list[str] = []

    def is_told(line: str) -> bool:
        asked, _, words = line.partition(" => ")
        time.sleep(0.2)  # each command is a client, and the server has room for 64 at once
        done = called(*asked.split(), server=server)
        said.append(f"{line}\n{done.status} {done.output}{done.error}")
        return all(part in said[-1].partition("\n")[2] for part in words.split(" … "))

    for line in text.splitlines():
        within = 10.0 * line.startswith("queue")
        wait_until(partial(is_told, line), within=within, what=lambda: said[-1])


def mav_tasks(
    *arguments: str, server: str = "", folder: Path | None = None, given: str = "", **more: str
) -> Done:
    """Run a command with pipes; ``given`` is its standard input, ``more`` of its environment.

    ``server``: its URL, ``folder``: the working directory.
    """
    done = subprocess.run(
        [sys.executable, "-m", "mav_tasks.cli", *arguments],
        capture_output=True,
        input=given,
        text=True,
        timeout=LIMIT,
        cwd=folder,
        env=surroundings(server, **more),
        check=False,
    )
    return Done(done.returncode, done.stdout, done.stderr)


def surroundings(server: str, **environment: str) -> dict[str, str]:
    """Return the environment of a command."""
    own = {"MAV_TASKS_SERVER": server} if server else {}
    return {**os.environ, "PYTHONIOENCODING": "utf-8", **own, **environment}
