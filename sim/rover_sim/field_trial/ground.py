"""What a trial needs of the place where it is held."""

from dataclasses import dataclass
from typing import Protocol

from mav_tasks.client.aio import Client
from mav_tasks.links.base import Link
from rover_sim.field_trial.track import Track


@dataclass(frozen=True, slots=True)
class Limits:
    """What must hold; GUIDE.md shows what was measured."""

    end: float = 0.05  # m, p95
    turn: float = 1.0  # deg, p95
    stop: float = 1.1  # times the better way's distance
    stick: float = 1.5  # s
    remainder: float = 0.05  # m


class Ground(Protocol):
    """A rover, a server that can be started, ended and killed, and clients of it."""

    #: true poses; None: nothing knows them, and the poses that the rover reports count
    truth: Track | None

    async def start_server(self) -> None:
        """Start the server, on the store that the last one left."""
        ...

    async def end_server(self) -> None:
        """End it in order, as SIGTERM does, and wait until it is gone."""
        ...

    async def kill_server(self) -> None:
        """Let it be gone from one moment to the next."""
        ...

    def client(self) -> Client:
        """Return a client, not opened yet."""
        ...

    def rover_link(self) -> Link | None:
        """Return a link to the rover itself, for use while no server runs; None: it has none."""
        ...

    @property
    def can_reboot(self) -> bool:
        """Whether ``reboot`` works."""
        ...

    async def reboot(self) -> None:
        """Restart the rover's autopilot."""
        ...

    @property
    def can_push_stick(self) -> bool:
        """Whether ``push_stick`` works."""
        ...

    def push_stick(self, throttle: int | None) -> None:
        """Hold the throttle stick so (µs) until told otherwise; None: let go."""
        ...
