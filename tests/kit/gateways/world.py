"""Gateways, database and vehicles in virtual time, with faults; every motion is judged."""

from collections.abc import Callable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import count
from random import Random

from mav_tasks.fleet.lease import Terms
from mav_tasks.fleet.member import Change, Join, Member, Request
from mav_tasks.fleet.standing import Effect, Standing
from tests.kit.gateways.database import Database

TICK = 0.05  # s, of a gateway's loop: set-points at 20 Hz
GIVEN_UP = 0.4  # s, for which an answer is awaited
PING = 0.1  # s
KEPT = 2.0  # s, after which the database ends the session of a gateway that is cut off


@dataclass
class Process:
    """A gateway's process, on a machine with a clock of its own."""

    member: Member
    rate: float  # of its monotonic clock, beside true time
    offset: float
    session: int | None = None
    latest_session: int | None = None  # it may be over
    asked: tuple[int, Request, float] | None = None  # its number, and when by its own clock
    is_dead: bool = False
    frozen_until: float = 0.0
    hears_database: bool = True
    reaches_database: bool = True
    is_reached_by_peers: bool = True
    effects: list[Effect] = field(default_factory=list)
    served: set[int] = field(default_factory=set)  # vehicles that its engine has
    forgotten: set[int] = field(default_factory=set)  # by its engine
    lives: int = 0  # of its engine


@dataclass
class World:
    """The fleet. ``judge`` is asked for each packet that a gateway would send to a vehicle."""

    random: Random
    vehicles: int = 3
    terms: Terms = field(default_factory=Terms)
    now: float = 0.0
    database: Database = field(default_factory=Database)
    processes: dict[str, Process] = field(default_factory=dict)  # by name, or as ``add`` says
    by_epoch: dict[int, Process] = field(default_factory=dict)  # whose address is in the row
    wrong: list[str] = field(default_factory=list)
    motions: int = 0
    freed: int = 0  # times that an engine gave a vehicle up
    slow: float = 0.01  # share of messages that take far too long
    _events: list[tuple[float, int, Callable[[], None]]] = field(default_factory=list)
    _count: "count[int]" = field(default_factory=count)

    def add(self, name: str, heard: set[int], *, label: str = "") -> Process:
        """Start a gateway's process; a ``label`` keeps it apart from another of its name."""
        member = Member(name, self.terms, heard)
        rate = 1.0 + self.random.uniform(-0.005, 0.005)  # fifty times a bad crystal
        it = self.processes[label or name] = Process(member, rate, self.random.uniform(0.0, 1e6))
        self.at(self.random.uniform(0.0, TICK), lambda: self._loop(it))
        self.at(self.random.uniform(0.0, PING), lambda: self._ping(it))
        return it

    def at(self, delay: float, what: Callable[[], None]) -> None:
        """Do something later."""
        heappush(self._events, (self.now + delay, next(self._count), what))

    def run(self, seconds: float) -> None:
        """Let time pass."""
        end = self.now + seconds
        while self._events and self._events[0][0] <= end:
            self.now, _, what = heappop(self._events)
            what()
        self.now = end

    def local(self, it: Process) -> float:
        """Return a gateway's monotonic time."""
        return self.now * it.rate + it.offset

    def end(self, it: Process) -> None:
        """SIGKILL: its sockets are closed by its machine."""
        it.is_dead = True
        if it.reaches_database:
            self.at(0.02, lambda: self._end_session(it.member.name, it.session))

    def cut(self, it: Process, *, hears: bool, reaches: bool) -> None:
        """Cut or mend its connection to the database, each way."""
        it.hears_database, it.reaches_database = hears, reaches
        if not (hears and reaches):
            session = it.session
            self.at(KEPT, lambda: self._keep_alive(it, session))

    def end_session(self, it: Process) -> None:
        """The database ends a session, or something between closes it on that side."""
        self._end_session(it.member.name, it.session)

    def _keep_alive(self, it: Process, session: int | None) -> None:
        if not (it.hears_database and it.reaches_database):
            self._end_session(it.member.name, session)

    def _end_session(self, name: str, session: int | None) -> None:
        if session is not None and self.database.sessions.get(name) == session:
            del self.database.sessions[name]

    def _loop(self, it: Process) -> None:
        if it.is_dead:
            return
        if it.frozen_until > self.now:
            self.at(it.frozen_until - self.now, lambda: self._loop(it))
            return
        member, now = it.member, self.local(it)
        it.effects += member.lease.passed(now)
        member.strays = frozenset(it.served - member.heard)
        is_holder = member.lease.standing is Standing.HOLDER and now < member.lease.trusted_until
        for vehicle in range(1, self.vehicles + 1):
            if is_holder and vehicle in it.served:
                self._judge(it, vehicle, "serves")
            if member.lease.may_move(vehicle, now):
                self.motions += 1
                self._judge(it, vehicle, "moves")
            elif member.lease.may_stop(vehicle, now):
                self._judge(it, vehicle, "stops")
        self._talk(it, now)
        self.at(TICK * self.random.uniform(0.9, 1.1), lambda: self._loop(it))

    def _judge(self, it: Process, vehicle: int, does: str) -> None:
        row = self.database.rows.get(it.member.name)
        if row is None or row.epoch != it.member.lease.epoch or vehicle not in row.holds:
            holder = self.database.holder(vehicle)
            self.wrong.append(f"{self.now:.3f}: {it.member.name} {does} {vehicle}, of {holder}")

    def _talk(self, it: Process, now: float) -> None:
        if it.asked is not None:
            if now - it.asked[2] > GIVEN_UP:
                it.asked, it.session = None, None
                self._take(it, it.member.unanswered(now))
            return
        if it.session is None:
            if it.hears_database and it.reaches_database and self.database.is_up:
                it.session = self.database.connect(it.member.name, it.latest_session)
                it.latest_session = it.session or it.latest_session
            return
        request = it.member.request(now)
        if request is not None:
            number, session = next(self._count), it.session
            it.asked = (number, request, now)
            self.at(self._delay(), lambda: self._arrive(it, session, number, request))

    def _arrive(self, it: Process, session: int, number: int, request: Request) -> None:
        """A request is carried out also if nobody waits for its answer any more."""
        if not it.reaches_database or not self.database.is_up:
            return
        if self.database.sessions.get(it.member.name) != session:
            if it.hears_database:
                self.at(self._delay(), lambda: self._closed(it, number))
            return
        row = self.database.execute(it.member.name, request)
        if isinstance(request, Join) and row.epoch:
            self.by_epoch[row.epoch] = it

        def answer() -> None:
            if it.is_dead or not it.hears_database:
                return
            if it.frozen_until > self.now:
                self.at(it.frozen_until - self.now + self._delay(), answer)
            elif it.asked is not None and it.asked[0] == number:
                sent = it.asked[2]
                it.asked = None
                now = self.local(it)
                self._take(it, it.member.answered(request, row, sent=sent, now=now))
                self._talk(it, now)

        self.at(self._delay(), answer)

    def _closed(self, it: Process, number: int) -> None:
        if not it.is_dead and it.asked is not None and it.asked[0] == number:
            it.asked, it.session = None, None
            self._take(it, it.member.unanswered(self.local(it)))

    def _take(self, it: Process, change: Change) -> None:
        it.effects += change.effects
        if Effect.DROP in change.effects:
            it.served.clear()
            it.forgotten.clear()
            it.lives += 1
        life = it.lives
        if change.got:
            it.forgotten -= change.got
            self.at(self._delay(), lambda: self._serve(it, life, change.got))
        asked = it.served.intersection(each for each, _ in change.lets_go) - it.forgotten
        if asked:
            self.at(self._delay(), lambda: self._forget(it, life, asked))

    def _serve(self, it: Process, life: int, vehicles: frozenset[int]) -> None:
        """The engine gets the data of vehicles."""
        if it.lives == life:
            it.served |= vehicles

    def _forget(self, it: Process, life: int, vehicles: set[int]) -> None:
        """The engine forgets the vehicles that it still does not hear; a while later it shows."""
        if it.frozen_until > self.now:
            self.at(it.frozen_until - self.now, lambda: self._forget(it, life, vehicles))
        elif it.lives == life:
            gone = frozenset(vehicles & it.served - it.member.heard)
            it.served -= gone
            it.forgotten |= gone
            self.at(self.random.uniform(0.0, PING), lambda: self._free(it, life, gone))

    def _free(self, it: Process, life: int, vehicles: frozenset[int]) -> None:
        if it.lives == life and not it.is_dead:
            self.freed += len(vehicles)
            it.member.forgotten(vehicles)

    def _ping(self, it: Process) -> None:
        if it.is_dead:
            return
        if it.frozen_until <= self.now and it.is_reached_by_peers:
            for name, epoch in it.member.rivals.epochs().items():
                other = self.by_epoch[epoch]
                if other is it or not other.is_reached_by_peers:
                    continue
                if other.is_dead:
                    it.member.peer_refused(name, now=self.local(it))
                elif other.frozen_until <= self.now and other.member.lease.epoch == epoch:
                    it.member.peer_answered(name, now=self.local(it))
        self.at(PING, lambda: self._ping(it))

    def _delay(self) -> float:
        """Return how long a message takes: mostly some ms, seldom far too long."""
        if self.random.random() < self.slow:
            return self.random.uniform(0.05, 1.5)
        return self.random.uniform(0.001, 0.012)
