"""The task server for tests: the one that ``mav-tasks serve`` runs, in virtual time.

A test can kill and restart it; acknowledged tasks survive, as on a disk.
"""

from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from mav_tasks.config.settings import Retention, Settings
from mav_tasks.shell.in_memory import InMemoryServer
from mav_tasks.store import MemoryStore
from mav_tasks.store.sqlite import SqliteStore
from mav_tasks.tasks.events import Event
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Task
from rover_sim.virtual import VirtualWorld

FOR_EVER = Retention(max_age=None, max_count=None)


class TaskServer:
    """One server for all rovers of a world, across its restarts."""

    def __init__(
        self,
        world: VirtualWorld,
        *,
        vehicles: tuple[str, ...],
        settings: Settings,
        wall_offset: float,  # UTC minus virtual time, s
    ) -> None:
        self.settings = settings  # applied at the next start
        self._world = world
        self._vehicles = vehicles
        self._wall_offset = wall_offset
        self._server: InMemoryServer | None = None
        self._is_killed = False
        self._store = MemoryStore()
        self._earlier: list[Event] = []

    def __repr__(self) -> str:
        state = "running" if self.is_running else "not running"
        return f"TaskServer({state}, {len(self.tasks)} tasks)"

    @property
    def is_running(self) -> bool:
        """Whether the server runs."""
        return self._server is not None and not self._is_killed and not self._server.pump.is_over

    @property
    def is_ready(self) -> bool:
        """Whether the server runs and has found every rover."""
        if self._server is None or not self.is_running:
            return False
        found = self._server.engine.snapshot(now=self._world.now).vehicles
        return len(found) == len(self._vehicles) and all(vehicle.heard for vehicle in found)

    @property
    def tasks(self) -> tuple[Task, ...]:
        """Every task of the running server, or of its last run, in the order of their ids."""
        if self._server is None:
            return ()
        return self._server.engine.snapshot(now=self._world.now).tasks

    @property
    def events(self) -> list[Event]:
        """The journal over all runs; ``str`` describes an event."""
        return self._earlier + self._store.events

    def task(self, task_id: int) -> Task:
        """Return a task by its id. Raise KeyError."""
        return {int(task.id): task for task in self.tasks}[task_id]

    def start(self) -> None:
        """Start the server on its store; it needs some seconds to find the rovers again."""
        if self.is_running:
            raise RuntimeError("the task server is running already")
        restored = self._end_life()
        self._server = InMemoryServer(
            self._world.net,
            vehicles=self._vehicles,
            settings=self.settings,
            store=self._store,
            restored=restored,
            wall_offset=self._wall_offset,
            now=self._world.now,
        )
        self._is_killed = False
        self._world.join(self._server)

    def kill(self) -> None:
        """End the server abruptly; nothing stops the rovers."""
        self._world.leave(self._running)
        self._is_killed = True

    def stop(self) -> None:
        """Request an orderly shutdown: the server stops the rovers and ends within a second."""
        self._running.shut_down(now=self._world.now)

    def restart(self) -> None:
        """Kill and start the server, as after a crash: active tasks are held, the queues paused."""
        self.kill()
        self.start()

    @property
    def _running(self) -> InMemoryServer:
        if self._server is None or not self.is_running:
            raise RuntimeError("the task server is not running")
        return self._server

    def _end_life(self) -> Restored | None:
        """Archive the events of the last run; return what it stored, or None without a run."""
        if self._server is None:
            return None
        if not self._is_killed:
            self._world.leave(self._server)
        self._earlier = self.events
        self._store = MemoryStore()
        idle = self._world.now - self._earlier[-1].at if self._earlier else 0.0
        return replace(
            stored(self._earlier),
            ended_well=not self._is_killed,
            idle=idle,
            wall_offset=self._wall_offset,
        )


def stored(events: list[Event]) -> Restored:
    """Return what the real store restores from these events."""
    with TemporaryDirectory(prefix="rover-sim-") as folder:
        path = Path(folder) / "tasks.sqlite3"
        opened = partial(SqliteStore, path, wall_offset=float, retention=FOR_EVER)
        with closing(opened()) as first:
            first.append(events)
        with closing(opened()) as again:
            return again.load()
