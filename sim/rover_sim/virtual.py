"""A world in virtual time: a memory net connects all parties, and nobody waits.

Time jumps from one due event to the next, so minutes of driving take only their computing time.
"""

from collections.abc import Callable
from typing import Protocol

from mav_tasks.links.memory import MemoryLink, MemoryNet
from rover_sim.vehicle import Vehicle, exchange


class Party(Protocol):
    """A participant: a server, a rover, a client."""

    def next_deadline(self) -> float | None:
        """Return when ``turn`` is due, unless something arrives before; None: never."""
        ...

    def turn(self, *, now: float) -> None:
        """Read what arrived, do what is due, send the results."""
        ...


class VirtualWorld:
    """Advances time for all parties of one net."""

    def __init__(self, net: MemoryNet) -> None:
        self.net = net
        self._parties: list[Party] = []
        self._watchers: list[Callable[[float], None]] = []

    @property
    def now(self) -> float:
        """Virtual seconds since the start of the world."""
        return self.net.now

    def join(self, *parties: Party) -> None:
        """Add parties."""
        self._parties += parties

    def leave(self, party: Party) -> None:
        """Remove a party, as if its process had been killed."""
        self._parties.remove(party)

    def watch(self, watcher: Callable[[float], None]) -> None:
        """Call ``watcher(now)`` after each step of time."""
        self._watchers.append(watcher)

    def run(self, seconds: float) -> None:
        """Advance time by ``seconds``."""
        self.run_until(lambda: False, within=seconds)

    def run_until(self, condition: Callable[[], bool], *, within: float) -> bool:
        """Advance time until the condition holds; return whether it held within the time."""
        end = self.now + within
        while not condition():
            if not self.step(end=end):
                return condition()
        return True

    def step(self, *, end: float) -> bool:
        """Advance to the next due event, but at most to ``end``; return whether there was one."""
        at = self.next_due()
        if at is None or at > end:
            self.net.now = end
            return False
        self.net.now = max(self.now, at)
        self.net.deliver()
        for party in list(self._parties):
            party.turn(now=self.now)
        for watcher in self._watchers:
            watcher(self.now)
        return True

    def next_due(self) -> float | None:
        """Return when the next event is due, or None if there is none."""
        due = [party.next_deadline() for party in self._parties]
        due.append(self.net.next_arrival())
        return min((at for at in due if at is not None), default=None)


class RoverParty:
    """A simulated rover on a link of the net."""

    def __init__(self, vehicle: Vehicle, link: MemoryLink) -> None:
        self.vehicle = vehicle
        self._link = link

    def next_deadline(self) -> float:
        """Return when the next control step is due."""
        return self.vehicle.next_deadline()

    def turn(self, *, now: float) -> None:
        """Receive, run due control steps, and send."""
        exchange(self._link, (self.vehicle,), now, len(self._link.arrived))
