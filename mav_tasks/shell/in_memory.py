"""The whole server on memory links, in the caller's virtual time: for tests and demonstrations.

It uses the same engine, store and pump as the runner, without sockets, clock and signals.
"""

from collections.abc import Mapping, Sequence

from mav_tasks.config.settings import Settings
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import (
    AtOnce,
    Input,
    KeysChanged,
    LinkSide,
    Outgoing,
    Packets,
    Shutdown,
    WallClock,
)
from mav_tasks.links.memory import MemoryLink, MemoryNet
from mav_tasks.links.policy import LinkPolicy
from mav_tasks.mavlink.signing import Key
from mav_tasks.recording.observer import EngineObserver
from mav_tasks.shell.pump import Pump
from mav_tasks.shell.runner import TAKES_ALL, link_changed
from mav_tasks.store import MemoryStore, Store
from mav_tasks.tasks.restored import Restored

CLIENT_LINK = "server:clients"
VEHICLE_LINK = "server:vehicles"


class InMemoryServer:
    """A server on a MemoryNet: clients address CLIENT_LINK, the server addresses ``vehicles``."""

    def __init__(
        self,
        net: MemoryNet,
        *,
        vehicles: tuple[str, ...],
        settings: Settings | None = None,
        store: Store | None = None,
        restored: Restored | None = None,
        observers: Sequence[EngineObserver] = (),
        wall_offset: float | None = None,  # UTC minus the caller's time, s; None: unknown
        policies: Mapping[str, LinkPolicy] | None = None,
        keys: tuple[Key, ...] | None = None,
        name: str = "server",
        others: Sequence[MemoryLink] = (),
        now: float = 0.0,
    ) -> None:
        """``policies``: by the name of a link. ``keys``: None if there is no key ring.

        The links of a server with another ``name`` begin with that. ``others`` are more links to
        clients.
        """
        self.engine = Engine(settings or Settings(), now=now, restored=restored)
        self.store = store or MemoryStore()
        self.pump = Pump(self.engine, self.store, self._send, observers=observers)
        clients = net.link(CLIENT_LINK.replace("server", name))
        towards = net.link(VEHICLE_LINK.replace("server", name), peers=vehicles)
        self._now = now
        links = (clients, towards, *others)
        self._links: dict[str, MemoryLink] = {link.name: link for link in links}
        if wall_offset is not None:
            self.pump.handle(WallClock(wall_offset), now=now)
        if keys is not None:
            self.pump.handle(KeysChanged(keys), now=now)
        sides = dict.fromkeys(self._links.values(), LinkSide.CLIENTS)
        sides[towards] = LinkSide.VEHICLES
        for link, side in sides.items():
            policy = (policies or {}).get(link.name, TAKES_ALL)
            self.pump.handle(link_changed(link, side, policy), now=now)
        self.pump.turn(now=now)

    def next_deadline(self) -> float | None:
        """Return when ``turn`` must be called next, if nothing arrives before."""
        return None if self.pump.is_over else self.engine.next_deadline()

    def turn(self, *, now: float) -> None:
        """Read the links, handle a due deadline, and send and store the results."""
        if self.pump.is_over:
            return
        self._now = now
        found = [
            Packets(link.name, *link.receive_timed(len(link.arrived)))
            for link in self._links.values()
            if link.arrived
        ]
        if found:
            self.pump.handle(AtOnce(tuple(found)) if len(found) > 1 else found[0], now=now)
        due = self.engine.next_deadline()
        if due is not None and due <= now:
            self.pump.handle_deadline(now=now)
        self.pump.turn(now=now)

    def shut_down(self, *, now: float) -> None:
        """Begin the orderly shutdown; ``pump.is_over`` is set within ``watch.shutdown`` seconds."""
        self.take_in(Shutdown(), now=now)

    def take_in(self, item: Input, *, now: float) -> None:
        """Handle an input that does not come from a link."""
        self._now = now
        self.pump.handle(item, now=now)
        self.pump.turn(now=now)

    def _send(self, outgoing: Outgoing) -> None:
        if self._now > outgoing.until:
            return
        self._links[outgoing.link].send(outgoing.peer, outgoing.data)
