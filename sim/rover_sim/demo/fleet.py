"""The demonstration of a fleet: one of two gateways is killed, and its rovers go on at the other.

PostgreSQL, the gateways "north" and "south", and four rovers are separate processes. Tasks are
submitted at one gateway, whichever has the rovers.
"""

import os
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing, suppress
from pathlib import Path

from mav_tasks.basics.errors import MavTasksError, NoAnswer
from mav_tasks.client.sync import SyncClient, SyncTask
from mav_tasks.kinds import Move
from mav_tasks.tasks.lifecycle import TERMINAL, TaskState
from rover_sim.demo.screen import Screen
from rover_sim.postgres import PostgresServer, installed
from rover_sim.testing.processes import ProcessFailed, free_ports, module, until

GATEWAYS = ("north", "south")
ROVERS = 4
METRES = 4.0
DRIVES = TaskState.EXECUTING
DRIVEN = 1.5  # s, before a gateway is killed
LIMIT = 120.0  # s, for each part


def drive(screen: Screen, *, body: str) -> int:
    """Show it; return how much went wrong. Raise ProcessFailed if it cannot be run."""
    try:
        with ExitStack() as ends:
            return _drive(screen, ends, body=body)
    except ModuleNotFoundError as error:
        raise ProcessFailed(f"--fleet needs a PostgreSQL: {error}") from error
    except (OSError, MavTasksError) as error:
        raise ProcessFailed(str(error)) from error


def _drive(screen: Screen, ends: ExitStack, *, body: str) -> int:
    folder = Path(ends.enter_context(tempfile.TemporaryDirectory(prefix="mav-tasks-demo-")))
    database = ends.enter_context(closing(PostgresServer(installed())))
    database.start()
    url = database.create_database("fleet")
    screen.say(f"PostgreSQL: {url}")
    rover_port, *ports = free_ports(1 + len(GATEWAYS))
    rovers = f"--port {rover_port} --body {body} --count {ROVERS}"
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
        until(
            lambda: len(_holders(url).get(GATEWAYS[0], ())) == ROVERS,
            within=LIMIT,
            what="rovers that are held",
        )
    killed, survivor = GATEWAYS
    client = ends.enter_context(SyncClient(f"udpout:127.0.0.1:{ports[-1]}", timeout=LIMIT))
    until(lambda: _are_ready(client), within=LIMIT, what="rovers that are ready")
    for name in GATEWAYS:
        screen.say(f"gateway {name} has {_named(_holders(url).get(name, ()))}")
    tasks = {
        vehicle: client.submit(Move(METRES), vehicle=vehicle) for vehicle in range(1, ROVERS + 1)
    }
    told = ", ".join(f"{task.id} for rover {vehicle}" for vehicle, task in tasks.items())
    screen.say(f"submitted at gateway {survivor}: task {told}: move {METRES:g} m")
    until(lambda: _all(client, tasks, DRIVES.__eq__), within=LIMIT, what="rovers that drive")
    time.sleep(DRIVEN)
    screen.say(f"the rovers drive; killing gateway {killed} now (SIGKILL)")
    began = time.monotonic()
    gateways[0].kill()
    until(
        lambda: len(_holders(url).get(survivor, ())) == ROVERS,
        within=LIMIT,
        what=f"gateway {survivor}",
    )
    screen.say(
        f"gateway {survivor} has {_named(tuple(tasks))} after {time.monotonic() - began:.1f} s:"
        " it stops them, and their tasks go on from there"
    )
    until(
        lambda: _all(client, tasks, TERMINAL.__contains__),
        within=LIMIT,
        what="the end of all tasks",
    )
    wrong = 0
    for vehicle, task in tasks.items():
        status = client.status(task.id, vehicle=vehicle)
        wrong += status.state is not TaskState.COMPLETED
        screen.say(f"rover {vehicle}: task {task.id} {status.state.name.lower()}")
    return wrong


def _holders(url: str) -> dict[str, list[int]]:
    """Return the rovers of each gateway, as the database has it."""
    import psycopg  # noqa: PLC0415  # an extra

    query = (
        "SELECT name, array_agg(vehicle ORDER BY vehicle) FROM mav_tasks.holdings"
        " JOIN mav_tasks.gateways ON gateway = gateways.number GROUP BY name"
    )
    with psycopg.connect(url) as connection:
        return dict(connection.execute(query).fetchall())


def _named(rovers: Sequence[int]) -> str:
    if not rovers:
        return "no rover"
    names = ", ".join(map(str, rovers))
    return f"rover {names}" if len(rovers) == 1 else f"rovers {names}"


def _are_ready(client: SyncClient) -> bool:
    rovers = client.vehicles()
    return len(rovers) == ROVERS and all(
        rover.is_ready and rover.position_age is not None for rover in rovers
    )


def _all(
    client: SyncClient, tasks: Mapping[int, SyncTask], fits: Callable[[TaskState], bool]
) -> bool:
    """Return whether the state of each task fits; one that nobody answers for does not."""
    with suppress(NoAnswer):
        return all(
            fits(client.status(task.id, vehicle=vehicle).state) for vehicle, task in tasks.items()
        )
    return False
