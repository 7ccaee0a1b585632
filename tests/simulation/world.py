"""The world of most stories: one server on a disk that outlives it."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from mav_tasks.config.settings import Settings
from mav_tasks.engine.inputs import WallClock
from mav_tasks.shell.in_memory import CLIENT_LINK
from mav_tasks.tasks.events import Event
from mav_tasks.tasks.lifecycle import TaskState
from rover_sim.personas import Persona
from tests.kit.halts import STALLED
from tests.simulation.disk import Crash, Disk, UncertainStore
from tests.simulation.judged import JudgedWorld
from tests.simulation.story import Cast, Move

SECOND_LINK = "server:second"
UTC = 1.8e9  # s, when the worlds begin
STALL = 0.8  # s of a stall, after which what drove is held
ENDS_WITHIN = 2.0  # s, for an orderly end of the server


class SimulatedWorld(JudgedWorld):
    """A JudgedWorld whose server may die."""

    def __init__(
        self, folder: Path, cast: Cast, *, seed: int, persona: Persona, settings: Settings
    ) -> None:
        self.disk = Disk(folder / "tasks.sqlite3", wall_offset=UTC)
        self.disk_store = UncertainStore()
        super().__init__(
            cast,
            seed=seed,
            settings=settings,
            store=self.disk_store,
            persona=persona,
            more_links=(SECOND_LINK,),
            client_links=(CLIENT_LINK, SECOND_LINK, CLIENT_LINK, CLIENT_LINK),
        )
        self._death: tuple[float, bool] | None = None  # when it ended, and whether in order
        self.stalled: tuple[float, list[int]] = 0.0, []  # since when, and who drove a task then
        self._away = 1.0  # s, until a server that died at a write is started again

    @property
    def journal(self) -> Sequence[Event]:
        """The events of the present server."""
        return self.disk_store.events

    def close(self) -> None:
        """Close the disk's file."""
        self.disk.close()

    def calm(self) -> None:
        """Let the disk be well."""
        store = self.disk_store
        store.delay = store.halts_delay = store.full_until = 0.0
        store.dies_in = 0

    def step(self, *, end: float) -> bool:
        """Advance to the next event; the server may die at it."""
        try:
            return super().step(end=end)
        except Crash:
            self._dies()
            self.judge(self.now)
            return True

    def fails(self, move: Move) -> None:
        """Let something happen to the server, its disk or its clock."""
        args, store = move.args, self.disk_store
        match f"{move.who} {move.what}":
            case "server SIGKILL":
                self.kill()
                self.later(args[0], self.start)
            case "server SIGTERM":
                self.end_in_order()
                self.later(args[0], self.start)
            case "server dies at a write":
                self._away = args[0]
                self.dies_at_write(args[1], before=args[2] == "before")
            case "server stands still":
                if self.freeze():
                    self.later(args[0], self.thaw)
            case "server reads late":
                self.later(args[1], self.read_late(args[1]))
            case "clock jumps":
                self.step_wall_clock(args[0])
            case "disk is full for":
                store.fill(args[0])
            case "disk takes":
                store.delay, store.halts_delay = args[0], 0.0
            case "disk keeps halts after":
                store.delay = store.halts_delay = args[0]
            case _:
                raise ValueError(move)

    # the server and its machine

    def kill(self) -> None:
        """Kill the server: what it has not stored is lost."""
        if not self.is_away:
            self._end(self.disk_store.committed(in_order=False), ended_well=False)

    def end_in_order(self) -> None:
        """End the server by SIGTERM; time passes until it has."""
        if self.is_away:
            return
        server = self.server
        self._guarded(lambda: server.shut_down(now=self.now))
        self.run_until(lambda: server.pump.is_over or self.is_away, within=ENDS_WITHIN)
        if not self.is_away:
            is_full = self.now < self.disk_store.full_until
            events = self.disk_store.committed(in_order=True)
            self._end(events, ended_well=server.pump.is_over and not is_full)

    def dies_at_write(self, number: int, *, before: bool) -> None:
        """Let the server die at one of its next writes."""
        self.disk_store.dies_in, self.disk_store.dies_before = number, before

    def start(self) -> None:
        """Start another server on the disk."""
        if self._death is None:
            return
        (died_at, well), self._death = self._death, None
        restored = self.disk.load(ended_well=well, idle=self.now - died_at)
        self.faults += self.ledger.restart(restored.tasks, killed_at=died_at)
        old, self.disk_store = self.disk_store, UncertainStore()
        self.disk_store.delay, self.disk_store.halts_delay = old.delay, old.halts_delay
        self.disk_store.clock = lambda: self.now
        self._followed, self.is_away, self.started_at = 0, False, self.now
        self.start_server(self.disk_store, restored)
        for observer in self.observers:
            self._restored(observer.system_id, restored)

    def freeze(self) -> bool:
        """Stop the server's process; what is sent to it waits. Return whether it ran."""
        if self.is_away:
            return False
        found = self.server.engine.snapshot(now=self.now).vehicles
        driven = [v.system_id for v in found if v.active and v.active.state is TaskState.EXECUTING]
        self.stalled = self.now, driven
        self.leave(self.server)
        self.watched.is_server_away = self.is_away = True
        return True

    def thaw(self) -> None:
        """Let the server's process run again."""
        self.watched.is_server_away = self.is_away = False
        self.join(self.server)
        since, driven = self.stalled
        for halts in self.halts if self.now - since > STALL else ():
            if halts.system_id in driven and not halts.in_force:
                halts.person(STALLED, drives=False, now=self.now)

    def read_late(self, seconds: float) -> Callable[[], None]:
        """Let the server not read the second link for a while; return what ends that."""
        self.watched.unread_links.setdefault(SECOND_LINK, [])
        self.disturb(0, seconds - 6.0)
        return partial(self.watched.read_again, SECOND_LINK)

    def step_wall_clock(self, seconds: float) -> None:
        """Make the wall clock of the server's machine jump."""
        self.disk.wall_offset += seconds
        if not self.is_away:
            news = WallClock(self.disk.wall_offset)
            self._guarded(lambda: self.server.take_in(news, now=self.now))

    def _guarded(self, act: Callable[[], object]) -> None:
        try:
            act()
        except Crash:
            self._dies()

    def _dies(self) -> None:
        self.counts["died at a write"] += 1
        self.disk_store.dies_in = 0
        self.later(self._away, self.start)
        self._end(self.disk_store.committed(in_order=False), ended_well=False)

    def _end(self, events: tuple[list[Event], list[Event]], *, ended_well: bool) -> None:
        self._follow()
        self.disk.write(*events)
        self.end_server()
        self._forget_requests()
        self.wishes.clear()
        self.is_away = True
        self._death = self.now, ended_well
        self.disturb(0)
