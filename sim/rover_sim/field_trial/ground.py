"""The environment that a trial needs."""

from dataclasses import dataclass
from typing import Protocol

from mav_tasks.client.aio import Client
from mav_tasks.links.base import Link
from rover_sim.field_trial.track import Track


@dataclass(frozen=True, slots=True)
class Limits:
    """The limits of the rows; GUIDE.md shows measured values."""

    end: float = 0.05  # m, p95
    turn: float = 1.0  # deg, p95
    stop: float = 1.1  # times the distance of the better way
    stick: float = 1.5  # s
    remainder: float = 0.05  # m


class Ground(Protocol):
    """A rover, a server that can be started, ended and killed, and its clients."""

    #: true poses; None: unknown, and the reported poses are used
    truth: Track | None

    async def start_server(self) -> None:
        """Start the server, on the store of the previous one."""
        ...

    async def end_server(self) -> None:
        """End the server like SIGTERM, and wait for its end."""
        ...

    async def kill_server(self) -> None:
        """Kill the server."""
        ...

    def client(self) -> Client:
        """Return a client that is not open yet."""
        ...

    def rover_link(self) -> Link | None:
        """Return a link to the rover, for use while no server runs, or None."""
        ...

    @property
    def can_reboot(self) -> bool:
        """Whether ``reboot`` is possible."""
        ...

    async def reboot(self) -> None:
        """Restart the rover's autopilot."""
        ...

    @property
    def can_push_stick(self) -> bool:
        """Whether ``push_stick`` is possible."""
        ...

    def push_stick(self, throttle: int | None) -> None:
        """Hold the throttle at a pulse (µs) until the next call; None releases it."""
        ...
