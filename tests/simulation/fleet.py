"""The world of some stories: gateways over one database, which fail and take rovers over."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from mav_tasks.config.settings import Settings
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.snapshot import VehicleSnapshot
from mav_tasks.tasks.events import Event
from mav_tasks.tasks.task import Task
from rover_sim.personas import Persona
from tests.kit.gateways.engines import FleetWorld, Gateway, moves
from tests.kit.words import Word
from tests.simulation.judged import SERVER, JudgedWorld
from tests.simulation.story import GATEWAYS, Cast, Move

SLOW = 0.01  # of the database's answers take too long
TAKES_OVER = 3.0  # s, until another gateway has the rovers of one that failed


class SimulatedFleet(JudgedWorld, FleetWorld):
    """A JudgedWorld with several gateways. What no gateway has stored is in no journal."""

    def __init__(
        self, folder: Path, cast: Cast, *, seed: int, persona: Persona, settings: Settings
    ) -> None:
        names = GATEWAYS[: cast.gateways]
        #: requests at one gateway for a rover of another
        self._passed: dict[bytes, Word] = {}
        super().__init__(
            cast,
            folder,
            names=names,
            seed=seed,
            settings=settings,
            persona=persona,
            client_links=[f"{name}:clients" for name in names],
        )
        self.slow = SLOW
        for observer in self.observers:
            observer.longest_gap = settings.watch.late_tick  # of a gateway that stood still

    @property
    def journal(self) -> Sequence[Event]:
        """The events that gateways have stored, in the order of their commits."""
        return self.shared.store.events

    def tasks(self) -> tuple[Task, ...]:
        """Return all stored tasks."""
        return self.shared.tasks()

    def engines(self) -> list[Engine]:
        """Return the engines of the gateways that run."""
        return [it.engine for it in self.gateways.values() if self._runs(it)]

    def seen(self) -> dict[int, VehicleSnapshot]:
        """Return each rover as its gateway sees it."""
        found = {}
        for halts in self.halts:
            it = self._gateway_of(halts.system_id)
            if it is not None and self._runs(it):
                for vehicle in it.engine.snapshot(now=self.now).vehicles:
                    if vehicle.system_id == halts.system_id:
                        found[vehicle.system_id] = vehicle
        return found

    def close(self) -> None:
        """Close the database's file."""
        self.shared.store.close()

    def calm(self) -> None:
        """Let all gateways run, and reach the database and the rovers."""
        self.database.is_up, self.slow = True, 0.0
        self.watched.cut.clear()
        for it in list(self.gateways.values()):
            self._begin_again(it.name)
            self._thaw(it.name)
            self._reach(it.name, is_reached=True)
            self.gateways[it.name].hears = self.gateways[it.name].is_pinged = True

    def taken(self, rover: int) -> None:
        """Note that another gateway serves a rover: it knows what is stored."""
        self._restored(rover, self.shared.part(frozenset({rover})))
        super().taken(rover)
        self._forget_requests()
        self.started_at = self.now

    def dropped(self, gateway: str) -> None:
        """Note that a gateway has lost its vehicles, and what it was asked for."""
        super().dropped(gateway)
        self._forget_requests()

    def passes_on(self, gateway: str, data: bytes, arrived: float) -> None:
        """Note that a gateway hands a client's request to the one that has the rover."""
        super().passes_on(gateway, data, arrived)
        word = self._passed.pop(data, None)
        if word is not None:
            self._obeyed_at(gateway, word, self.now - arrived)

    # what fails

    def fails(self, move: Move) -> None:
        """Let something fail at a gateway, and end after a while."""
        name = move.who.removeprefix("gateway ")
        self.later(move.args[0], self._fails(name, move.what))

    def _fails(self, name: str, what: str) -> Callable[[], object]:
        """Let something fail; return what ends that."""
        it = self.gateways[name]
        if not self._runs(it):
            return lambda: None
        self.disturb(0, TAKES_OVER)
        match what:
            case "SIGKILL":
                self._end(name, self.kill)
                return partial(self._begin_again, name)
            case "SIGTERM":
                self._end(name, self.end)
                return partial(self._begin_again, name)
            case "stands still":
                self.freeze(name)
                self._leave_unread(name)
                return partial(self._thaw, name)
            case "does not reach the database":
                self._reach(name, is_reached=False)
                return partial(self._reach, name, is_reached=True)
            case "does not reach the rovers":
                for halts in self.halts:
                    self.cut(name, halts.system_id)
                return partial(self._mend_all, name)
            case "loses its session":
                self.database.sessions.pop(name, None)
                return lambda: None
            case "hears no answers":
                it.hears = False
                return lambda: setattr(it, "hears", True)
            case "is not pinged":
                it.is_pinged = False
                return lambda: setattr(it, "is_pinged", True)
            case "loses its database":
                self.database.restart()
                self.database.is_up = False
                return lambda: setattr(self.database, "is_up", True)
        raise ValueError(what)

    def _end(self, name: str, end: Callable[[str], None]) -> None:
        end(name)
        self._leave_unread(name)
        self._forget_requests()

    def _begin_again(self, name: str) -> None:
        if self.gateways[name].is_dead:
            for link in self._links(name):
                self.watched.unread_links.pop(link, None)
            self.start(name)
            self.disturb(0, TAKES_OVER)

    def _thaw(self, name: str) -> None:
        it = self.gateways[name]
        if it.is_frozen:
            it.is_frozen = False
            for link in self._links(name):
                self.watched.read_again(link)
            self.disturb(0, TAKES_OVER)

    def _leave_unread(self, name: str) -> None:
        for link in self._links(name):
            self.watched.unread_links[link] = []

    def _links(self, name: str) -> tuple[str, str]:
        return f"{name}:clients", f"{name}:vehicles"

    def _reach(self, name: str, *, is_reached: bool) -> None:
        it = self.gateways[name]
        it.is_reached = it.store.is_reached = is_reached

    def _mend_all(self, name: str) -> None:
        for halts in self.halts:
            self.mend(name, halts.system_id)

    # what passes

    def _runs(self, it: Gateway) -> bool:
        return not it.is_dead and not it.is_frozen

    def _gateway_of(self, rover: int) -> Gateway | None:
        return self.gateways.get(self.database.holder(rover) or "")

    def _passes_by(self, source: str, target: str, data: bytes) -> bool:
        if source in self.watched.to_vehicles and target in self.watched.observers and moves(data):
            name = source.partition(":")[0]
            holder = self.database.holder(int(target.removeprefix("rover")))
            if holder != name:
                self.faults.append(f"gateway {name} moves {target}, which {holder} has")
        return super()._passes_by(source, target, data)

    def _server_reads(self, peer: str, data: bytes, waited: float) -> None:
        word = self.words.word(peer, data)
        if word is None:
            return
        name = self.senders[peer].server.partition(":")[0]
        member = self.gateways[name].member
        known = {0, SERVER, *member.lease.vehicles, *member.rivals.held()}
        self._note_asked(word, is_known=word.system_id in known)
        self._obeyed_at(name, word, waited)
        self._passed[data] = word

    def _obeyed_at(self, gateway: str, word: Word, waited: float) -> None:
        held = [h for h in self.halts if self.database.holder(h.system_id) == gateway]
        self._obeys(word, waited, held)
