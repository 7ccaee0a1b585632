"""The demonstration of a fleet: one of two gateways is killed, and its rovers go on at the other.

PostgreSQL, the gateways "north" and "south", and four rovers are separate processes. Tasks are
submitted at one gateway, whichever has the rovers.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing, suppress
from pathlib import Path

from mav_tasks.basics.errors import MavTasksError, NoAnswer
from mav_tasks.client.sync import SyncClient, SyncTask
from mav_tasks.kinds import Move
from mav_tasks.tasks.lifecycle import TERMINAL, TaskState
from rover_sim.demo.processes import STOP_LIMIT, DemoError, free_ports, process
from rover_sim.demo.screen import Screen
from rover_sim.postgres import PostgresServer, installed

GATEWAYS = ("north", "south")
ROVERS = 4
METRES = 4.0
DRIVES = TaskState.EXECUTING
DRIVEN = 1.5  # s, before a gateway is killed
LIMIT = 120.0  # s, for each part
LOOK = 0.1  # s


def drive(screen: Screen, *, body: str) -> int:
    """Show it; return how much went wrong. Raise DemoError if it cannot be run."""
    try:
        with ExitStack() as ends:
            return _drive(screen, ends, body=body)
    except ModuleNotFoundError as error:
        raise DemoError(f"--fleet needs a PostgreSQL: {error}") from error
    except (OSError, MavTasksError) as error:
        raise DemoError(str(error)) from error


def _drive(screen: Screen, ends: ExitStack, *, body: str) -> int:
    folder = Path(ends.enter_context(tempfile.TemporaryDirectory(prefix="mav-tasks-demo-")))
    database = ends.enter_context(closing(PostgresServer(installed())))
    database.start()
    url = database.create_database("fleet")
    screen.say(f"PostgreSQL: {url}")
    rover_port, *ports = free_ports(1 + len(GATEWAYS))
    rovers = [sys.executable, "-m", "rover_sim", "--port", str(rover_port), "--body", body]
    rovers += ["--count", str(ROVERS)]
    ends.enter_context(process(rovers, folder / "rovers.log"))
    gateways = []
    for name, port in zip(GATEWAYS, ports, strict=True):
        gateways.append(_Gateway(folder, name, port, rover_port, url))
        ends.enter_context(closing(gateways[-1]))
        # the second begins when the first has all of them, or it might get them instead
        _until(
            lambda: len(_holders(url).get(GATEWAYS[0], ())) == ROVERS, what="rovers that are held"
        )
    killed, survivor = GATEWAYS
    client = ends.enter_context(SyncClient(f"udpout:127.0.0.1:{ports[-1]}", timeout=LIMIT))
    _until(lambda: _are_ready(client), what="rovers that are ready")
    for name in GATEWAYS:
        screen.say(f"gateway {name} has {_named(_holders(url).get(name, ()))}")
    tasks = {
        vehicle: client.submit(Move(METRES), vehicle=vehicle) for vehicle in range(1, ROVERS + 1)
    }
    told = ", ".join(f"{task.id} for rover {vehicle}" for vehicle, task in tasks.items())
    screen.say(f"submitted at gateway {survivor}: task {told}: move {METRES:g} m")
    _until(lambda: _all(client, tasks, DRIVES.__eq__), what="rovers that drive")
    time.sleep(DRIVEN)
    screen.say(f"the rovers drive; killing gateway {killed} now (SIGKILL)")
    began = time.monotonic()
    gateways[0].kill()
    _until(lambda: len(_holders(url).get(survivor, ())) == ROVERS, what=f"gateway {survivor}")
    screen.say(
        f"gateway {survivor} has {_named(tuple(tasks))} after {time.monotonic() - began:.1f} s:"
        " it stops them, and their tasks go on from there"
    )
    _until(lambda: _all(client, tasks, TERMINAL.__contains__), what="the end of all tasks")
    wrong = 0
    for vehicle, task in tasks.items():
        status = client.status(task.id, vehicle=vehicle)
        wrong += status.state is not TaskState.COMPLETED
        screen.say(f"rover {vehicle}: task {task.id} {status.state.name.lower()}")
    return wrong


class _Gateway:
    """A gateway's process, which may be killed."""

    def __init__(
        self, folder: Path, name: str, client_port: int, rover_port: int, url: str
    ) -> None:
        self.name = name
        command = [sys.executable, "-m", "mav_tasks.cli", "serve", "--config", ""]
        command += ["--gateway", name, "--store", url, "--no-push"]
        command += ["--client", f"udpin:127.0.0.1:{client_port}"]
        command += ["--vehicle", f"udpout:127.0.0.1:{rover_port}"]
        command += ["--set", "rules.on_takeover=resume"]
        # its record of halts must not lie among those of the user's servers
        environment = {**os.environ, "XDG_DATA_HOME": str(folder / name)}
        self._log = folder / f"{name}.log"
        with self._log.open("wb") as output:
            self._process = subprocess.Popen(
                command, stdout=output, stderr=subprocess.STDOUT, env=environment
            )
        _until(self._has_begun, what=f"gateway {name}")

    def kill(self) -> None:
        """End it as a crash would."""
        self._process.kill()
        self._process.wait()

    def close(self) -> None:
        """End it, if it runs."""
        self._process.terminate()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(STOP_LIMIT)
        self.kill()

    def _has_begun(self) -> bool:
        if self._process.poll() is not None:
            raise DemoError(f"gateway {self.name} ended: {self._log.read_text(errors='replace')}")
        return f"as gateway {self.name}" in self._log.read_text(errors="replace")


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


def _until(condition: Callable[[], bool], *, what: str) -> None:
    end = time.monotonic() + LIMIT
    while not condition():
        if time.monotonic() > end:
            raise DemoError(f"waited {LIMIT:.0f} s for {what}")
        time.sleep(LOOK)
