"""The demonstration of a fleet: one of two gateways is killed, and its rovers go on at the other.

PostgreSQL, the gateways "north" and "south", and four rovers are separate processes. Tasks are
submitted at one gateway, whichever has the rovers.
"""

import os
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing, suppress
from pathlib import Path

from typer import echo

from mav_tasks.basics.errors import NoAnswer
from mav_tasks.client.sync import SyncClient
from mav_tasks.kinds import Move
from mav_tasks.tasks.lifecycle import TERMINAL, TaskState
from rover_sim.postgres import PostgresServer, installed
from rover_sim.testing.processes import ProcessFailed, free_ports, module, until

GATEWAYS = ("north", "south")
ROVERS = range(1, 5)
METRES = 4.0
DRIVEN = 1.5  # s, before a gateway is killed
LIMIT = 120.0  # s, for each part


def drive(*, body: str) -> int:
    """Show it; return how much went wrong. Raise ProcessFailed, OSError or MavTasksError."""
    with ExitStack() as ends:
        try:
            database = ends.enter_context(closing(PostgresServer(installed())))
        except ModuleNotFoundError as error:
            raise ProcessFailed(f"--fleet needs a PostgreSQL: {error}") from error
        database.start()
        url = database.create_database("fleet")
        echo(f"PostgreSQL: {url}")
        return _drive(ends, url, body)


def _drive(ends: ExitStack, url: str, body: str) -> int:
    folder = Path(ends.enter_context(tempfile.TemporaryDirectory(prefix="mav-tasks-demo-")))

    def until_it_has_all(gateway: str) -> None:
        _wait(lambda: held_by(url, gateway) == list(ROVERS), f"gateway {gateway}")

    rover_port, *ports = free_ports(1 + len(GATEWAYS))
    rovers = f"--port {rover_port} --body {body} --count {len(ROVERS)}"
    ends.enter_context(module("rover_sim", rovers, folder=folder))
    gateways = []
    for name, port in zip(GATEWAYS, ports, strict=True):
        text = f"serve --config= --gateway {name} --no-push --set rules.on_takeover=resume"
        text += f" --client udpin:127.0.0.1:{port} --vehicle udpout:127.0.0.1:{rover_port} --store"
        # its record of halts must not lie among those of the user's servers
        env = {**os.environ, "XDG_DATA_HOME": str(folder / name)}
        gateway = ends.enter_context(module("mav_tasks.cli", text, url, folder=folder, env=env))
        gateway.said(f"as gateway {name}", within=LIMIT)
        gateways.append(gateway)
        # the second begins when the first has all of them, or it might get them instead
        until_it_has_all(GATEWAYS[0])
    killed, survivor = GATEWAYS
    client = ends.enter_context(SyncClient(f"udpout:127.0.0.1:{ports[-1]}", timeout=LIMIT))
    _wait(lambda: len(client.vehicles()) == len(ROVERS), "rovers that are known")
    for name in GATEWAYS:
        echo(f"gateway {name} has {_named(held_by(url, name))}")
    tasks = {rover: client.submit(Move(METRES), vehicle=rover) for rover in ROVERS}
    told = ", ".join(f"{task.id} for rover {rover}" for rover, task in tasks.items())
    echo(f"submitted at gateway {survivor}: task {told}: move {METRES:g} m")

    def states() -> list[TaskState]:
        """Return the state of each task that somebody answers for."""
        with suppress(NoAnswer):
            return [client.status(task.id, vehicle=rover).state for rover, task in tasks.items()]
        return []

    _wait(lambda: states() == [TaskState.EXECUTING] * len(ROVERS), "rovers that drive")
    time.sleep(DRIVEN)
    echo(f"the rovers drive; killing gateway {killed} now (SIGKILL)")
    began = time.monotonic()
    gateways[0].kill()
    until_it_has_all(survivor)
    took = f"{time.monotonic() - began:.1f} s"
    echo(
        f"gateway {survivor} has {_named(ROVERS)} after {took}: it stops them, and their tasks go"
        " on from there"
    )
    _wait(lambda: TERMINAL.issuperset(states() or [TaskState.QUEUED]), "the end of all tasks")
    ended = states()
    for (rover, task), state in zip(tasks.items(), ended, strict=True):
        echo(f"rover {rover}: task {task.id} {state.name.lower()}")
    return len(ROVERS) - ended.count(TaskState.COMPLETED)


def _wait(condition: Callable[[], bool], what: str) -> None:
    until(condition, within=LIMIT, what=what)


def held_by(url: str, gateway: str) -> list[int]:
    """Return the rovers of a gateway, as the database has it."""
    import psycopg  # noqa: PLC0415  # an extra

    query = (
        "SELECT vehicle FROM mav_tasks.holdings"
        " JOIN mav_tasks.gateways ON gateway = gateways.number WHERE name = %s ORDER BY vehicle"
    )
    with psycopg.connect(url) as connection:
        return [vehicle for (vehicle,) in connection.execute(query, (gateway,))]


def _named(rovers: Sequence[int]) -> str:
    return f"rovers {', '.join(map(str, rovers))}" if rovers else "no rover"
