"""A fleet at work for a long time, and its server's memory.

Memory is the total size of all objects that the server's own objects hold: this is exact, and the
same in each run. Resident memory is coarser than a leak, and includes the simulated rovers;
tracemalloc takes three times as long. Memory outside the server's objects is not measured: it has
only tables of constants.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from time import process_time
from unittest import mock

from mav_tasks.settings import Clients, Retention, Settings
from mav_tasks.store import MemoryStore
from mav_tasks.tasks.events import Event
from tests.kit.client import FakeClient
from tests.kit.soak.bounds import reachable
from tests.kit.soak.disk import Disk
from tests.kit.soak.world import GRAIN, UTC
from tests.kit.world import World

KEPT_TASKS = 40  # finished tasks, in memory and on the disk: as many as end in a quarter
GROWTH = 1.10  # limit on memory at the end, relative to the first quarter
PERIOD = 1.0  # s, between two actions
FORGET = 10.0  # s
FULL = 260  # commands of a client; the server remembers 256


@dataclass(frozen=True)
class HourSettings:
    """Duration, and number of rovers and clients."""

    seconds: float = 3600.0
    rovers: int = 5
    clients: int = 10
    kept: int = KEPT_TASKS


class Drain(MemoryStore):
    """Writes everything to the disk at once, and keeps nothing."""

    def __init__(self, disk: Disk) -> None:
        super().__init__()
        self._disk = disk
        self.now: Callable[[], float] = lambda: 0.0

    def append(self, events: Sequence[Event]) -> None:
        """Write events."""
        self._disk.write(events, now=self.now())
        self._count += len(events)


class Hour:
    """Rovers that receive small tasks from many clients, again and again."""

    def __init__(self, settings: HourSettings, *, seed: int) -> None:
        self._settings = settings
        self._seed = seed
        self._random = Random(seed)

    def run(self, *, leak: Callable[[World], object] = lambda _: None) -> Iterator[str]:
        """Run; yield lines of progress. Raise AssertionError if memory has grown.

        ``leak`` is called at each action, to prove that the check detects a leak.
        """
        began = process_time()
        with TemporaryDirectory(prefix="hour-") as folder, ExitStack() as stack:
            disk = Disk(Path(folder) / "tasks.sqlite3", wall_offset=UTC)
            stack.callback(disk.close)
            kept = self._settings.kept
            stack.enter_context(mock.patch("mav_tasks.tasks.registry.KEPT_FINISHED", kept))
            world, clients = self._world(disk)
            quarter = self._settings.seconds / 4
            sizes: list[int] = []
            for number in range(1, 5):
                self._live(world, clients, disk, until=number * quarter, leak=leak)
                sizes.append(held_by(world.server))
                count = world.tasks()[-1].id if world.tasks() else 0
                yield f"{world.now:.0f} s: {sizes[-1] / 1000:.0f} kB, {count} tasks so far"
            ratio = sizes[-1] / sizes[0]
            spent = process_time() - began
            yield f"in the end {ratio:.3f} of the first quarter's; {spent:.0f} s of processor time"
            assert ratio <= GROWTH, (
                f"seed {self._seed}: memory has grown by a factor of {ratio:.2f}"
            )
            world.check()

    def _world(self, disk: Disk) -> tuple["GrainyWorld", list[FakeClient]]:
        settings = Settings(clients=Clients(stream_interval=1.0), on_failure="continue")
        store = Drain(disk)
        world = GrainyWorld(
            seed=self._seed, rovers=self._settings.rovers, store=store, settings=settings
        )
        store.now = lambda: world.now
        for observer in world.observers:
            observer.expects_gaps = observer.batches = observer.expects_late_modes = True
        clients = [world.client] + [
            world.add_client(f"client{number}", system_id=100 + number)
            for number in range(1, self._settings.clients)
        ]
        world.ready()
        for number in range(FULL):  # fill the server's memory of commands to its limit
            for client in clients:
                client.request_status(number + 1)
            world.run(0.02)
        forget(world, clients)
        return world, clients

    def _live(
        self,
        world: World,
        clients: list[FakeClient],
        disk: Disk,
        *,
        until: float,
        leak: Callable[[World], object],
    ) -> None:
        random, forget_at = self._random, 0.0
        while world.now < until:
            rover = random.randint(1, self._settings.rovers)
            target, client = (rover, 191), random.choice(clients)
            match random.randrange(8):
                case 0 | 1 | 2:
                    nonce = random.randrange(1, 1 << 24)
                    client.move(random.choice((-0.3, 0.3)), nonce=nonce, target=target)
                case 3:
                    client.rotate(random.choice((-20, 20)), target=target)
                case 4:
                    client.request_status(random.randrange(1, 200), target=target)
                case 5:
                    client.pause(target=target)
                case 6:
                    client.stop(clear=True, target=target)
            for number in range(1, self._settings.rovers + 1):
                if random.random() < 0.5:
                    client.proceed(target=(number, 191))
            leak(world)
            world.run(PERIOD)
            if world.now >= forget_at:
                forget_at = world.now + FORGET
                disk.forget(Retention(max_age=None, max_count=self._settings.kept), now=world.now)
                forget(world, clients)


class GrainyWorld(World):
    """A world that handles all events within a grain together."""

    def next_due(self) -> float | None:
        """Return the time of the next event, in whole grains."""
        due = super().next_due()
        return None if due is None else max(due, -(-due // GRAIN) * GRAIN)


def forget(world: World, clients: list[FakeClient]) -> None:
    """Clear the records that only the test keeps."""
    for client in clients:
        client.received.clear()
        client.acks.clear()
        client._under_way.clear()
    for observer in world.observers:
        observer.driven.clear()
        observer.reached.clear()


def held_by(server: object) -> int:
    """Return the total size of a server's objects and of everything that they hold, bytes."""
    return sum(sys.getsizeof(value) for _, value in reachable(server))
