"""A world in virtual time: whoever takes part is joined by a memory net, and nobody waits.

Time jumps from one thing that is due to the next, so that minutes of driving take as long as their
arithmetic.
"""

from collections.abc import Callable
from typing import Protocol

from mav_tasks.links.memory import MemoryLink, MemoryNet
from rover_sim.vehicle import Vehicle


class Party(Protocol):
    """One who takes part: a server, a rover, a client."""

    def next_deadline(self) -> float | None:
        """Return when ``turn`` has something to do, unless something arrives before."""
        ...

    def turn(self, *, now: float) -> None:
        """Read what has arrived, do what is due, send what follows."""
        ...


class VirtualWorld:
    """Moves time for all parties of one net."""

    def __init__(self, net: MemoryNet) -> None:
        self.net = net
        self._parties: list[Party] = []
        self._watchers: list[Callable[[float], None]] = []

    @property
    def now(self) -> float:
        """Virtual seconds since the world began."""
        return self.net.now

    def join(self, *parties: Party) -> None:
        """Let parties take part from now on."""
        self._parties += parties

    def leave(self, party: Party) -> None:
        """Take a party out, as if its process had been killed."""
        self._parties.remove(party)

    def watch(self, watcher: Callable[[float], None]) -> None:
        """Call ``watcher(now)`` after each step of time."""
        self._watchers.append(watcher)

    def run(self, seconds: float) -> None:
        """Let this much time pass."""
        self.run_until(lambda: False, within=seconds)

    def run_until(self, condition: Callable[[], bool], *, within: float) -> bool:
        """Let time pass until the condition holds; whether it did within so many seconds."""
        end = self.now + within
        while not condition():
            if not self.step(end=end):
                return condition()
        return True

    def step(self, *, end: float) -> bool:
        """Let time pass up to what is due next, or else to ``end``; whether anything was."""
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
        """Return when the next thing is due; None: nothing ever is."""
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
        """Let the rover hear, live and speak."""
        for peer, data in self._link.receive(len(self._link.arrived)):
            self.vehicle.receive(data, peer, now=now)
        self.vehicle.handle_deadline(now=now)
        for peer, data in self.vehicle.take_packets():
            self._link.send(peer, data)
