"""Faults of real gateways, their database and the nets between them, at random moments."""

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, field
from random import Random

from tests.kit.gateways.real import Fleet, Gateway
from tests.kit.processes import START_LIMIT, wait_until

LONGEST = 2.5  # s of a disturbance; two terms and a half
CALM = 0.4  # s in which all gateways read each other's rows and answer each other's pings


def passed(seconds: float) -> None:
    """Let time pass: how long a fault lasts is its size."""
    end = time.monotonic() + seconds
    wait_until(lambda: time.monotonic() >= end, within=seconds + START_LIMIT)


@dataclass
class Faults:
    """Disturbs a fleet, and records how long its vehicles had no mover, in seconds."""

    fleet: Fleet
    chance: Random
    after_kill: list[float] = field(default_factory=list)
    after_silence: list[float] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    _is_frozen: bool = False  # the database

    def one(self) -> str:
        """Cause a fault, wait until all is well again, and return its name."""
        kinds: list[Callable[[], None]] = [
            self.killed,
            self.killed,
            self.suspended,
            self.cut_off,
            self.killed_unnoticed,
            self.database_restarted,
            self.second_process,
            *[self.disturbed] * 5,
        ]
        kind = self.chance.choice(kinds)
        self.counts[kind.__name__] = self.counts.get(kind.__name__, 0) + 1
        passed(CALM + self.chance.uniform(0.0, 0.3))
        kind()
        self.fleet.settle()
        return kind.__name__

    def killed(self) -> None:
        """SIGKILL: its sockets are closed by its machine."""
        holder, since = self._holder(), time.monotonic()
        holder.kill()
        self.after_kill += self.fleet.taken_from(holder, since=since).values()
        self._again(holder)

    def killed_unnoticed(self) -> None:
        """Its machine is off: no more pings, and the database keeps the session."""
        holder = self._holder()
        with self._deaf(holder), self.fleet.proxies[holder.name].held():
            since = time.monotonic()
            holder.send(signal.SIGSTOP)  # its port stays open: nobody says that it has ended
            self.after_silence += self.fleet.taken_from(holder, since=since).values()
            holder.kill()
        self._again(holder)

    def suspended(self) -> None:
        """SIGSTOP until others have its vehicles; then it goes on where it was."""
        holder, since = self._holder(), time.monotonic()
        holder.send(signal.SIGSTOP)
        self.after_silence += self.fleet.taken_from(holder, since=since).values()
        holder.send(signal.SIGCONT)

    def cut_off(self) -> None:
        """The net to the database is cut; with it, perhaps, pings; the database may notice."""
        holder = self._holder()
        proxy = self.fleet.proxies[holder.name]
        deaf = self._deaf(holder) if self.chance.random() < 0.5 else nullcontext()
        with deaf, proxy.held():
            since = time.monotonic()
            if self.chance.random() < 0.5:
                proxy.close_far_side()
            self.after_silence += self.fleet.taken_from(holder, since=since).values()
            if self.chance.random() < 0.5:
                proxy.fall_silent()  # what was under way is lost, else it comes late

    def database_restarted(self) -> None:
        """Nobody may take what its holder still has."""
        before = self.fleet.settle()
        self._restart()
        after = self.fleet.settle()
        for vehicle, motion in before.items():
            holder = (motion.epoch, motion.pid)
            assert (after[vehicle].epoch, after[vehicle].pid) == holder, self.fleet.said()

    def second_process(self) -> None:
        """A second process of a name begins; the first may be losing its sessions meanwhile."""
        holder = self._holder()
        is_losing = self.chance.random() < 0.7
        second = self.fleet.start(holder.name)
        while not second.has_begun():
            if is_losing:
                self._end_session(holder)
            passed(0.02)
        passed(self.chance.uniform(0.0, 1.5))
        second.kill()

    def disturbed(self) -> None:
        """Several things at once, for a while."""
        ended: list[Gateway] = []
        with ExitStack() as over:
            for _ in range(self.chance.choice((0, 1, 1, 2))):
                gateway = self.chance.choice(list(self.fleet.gateways.values()))
                over.enter_context(self.chance.choice(self._states())(gateway))
            passed(self.chance.uniform(0.0, LONGEST / 2))
            gateway = self._holder() if self.chance.random() < 0.7 else self._any()
            match self.chance.randrange(5):
                case 0:
                    gateway.kill()
                    ended.append(gateway)
                case 1 if not self._is_frozen:  # its operator could not log in
                    self._end_session(gateway)
                case 2:
                    self.fleet.proxies[gateway.name].close_far_side()
                case 3:
                    self.fleet.proxies[gateway.name].fall_silent()
                case _:
                    pass
            passed(self.chance.uniform(0.0, LONGEST / 2))
        for each in ended:
            self._again(each)

    def _states(self) -> list[Callable[[Gateway], AbstractContextManager[None]]]:
        return [self._stopped, self._held, self._refusing, self._deaf, self._frozen_database]

    @contextmanager
    def _stopped(self, gateway: Gateway) -> Iterator[None]:
        gateway.send(signal.SIGSTOP)
        try:
            yield
        finally:
            if gateway.is_running():
                gateway.send(signal.SIGCONT)

    @contextmanager
    def _deaf(self, gateway: Gateway) -> Iterator[None]:
        gateway.say("deaf")
        try:
            yield
        finally:
            if gateway.is_running():
                gateway.say("hears")

    def _held(self, gateway: Gateway) -> AbstractContextManager[None]:
        return self.fleet.proxies[gateway.name].held()

    def _refusing(self, gateway: Gateway) -> AbstractContextManager[None]:
        return self.fleet.proxies[gateway.name].refusing()

    @contextmanager
    def _frozen_database(self, _gateway: Gateway) -> Iterator[None]:
        was_frozen, self._is_frozen = self._is_frozen, True
        try:
            with nullcontext() if was_frozen else self.fleet.server.frozen():
                yield
        finally:
            self._is_frozen = was_frozen

    def _restart(self) -> None:
        if self.chance.random() < 0.5:
            self.fleet.server.stop()
        else:
            self.fleet.server.kill()
        self.fleet.server.start()

    def _end_session(self, gateway: Gateway) -> None:
        self.fleet.server.execute(
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = %s",
            (f"mav-tasks gateway {gateway.name}",),
        )

    def _holder(self) -> Gateway:
        """Return a gateway that moves a vehicle; any if there is none now."""
        movers = list(self.fleet.movers(since=time.monotonic() - 1.0).values())
        return self.fleet.gateways[self.chance.choice(movers).name] if movers else self._any()

    def _any(self) -> Gateway:
        return self.chance.choice(list(self.fleet.gateways.values()))

    def _again(self, gateway: Gateway) -> None:
        self.fleet.again(gateway.name)
        started = self.fleet.gateways[gateway.name]
        wait_until(started.has_begun, within=START_LIMIT, what=self.fleet.said)
        assert started.is_running(), started.text
