"""Gateways for tests: each a lease and the store under it, in this process."""

import select
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

from mav_tasks.engine.inputs import Committed
from mav_tasks.fleet.io.lease_database import Answer, LeaseDatabase
from mav_tasks.fleet.member import Evict, Join, Renew, Request
from mav_tasks.fleet.rivals import Eviction
from mav_tasks.store import Outcome
from mav_tasks.store.postgres import address
from mav_tasks.store.postgres.failures import PostgresError
from mav_tasks.store.postgres.fleet_store import FleetStore
from mav_tasks.tasks.events import TaskSubmitted
from tests.kit.postgres import PostgresServer, connected
from tests.unit.store.samples import FOR_EVER, OFFSET, submitted

PATIENCE = 20.0  # s
PATIENT = 3  # times without an answer: a busy machine stands still now and then
Kind = TypeVar("Kind", bound=Outcome)


class Hang:
    """A lock that writes wait for after their fence."""

    def __init__(self, connection: Any) -> None:
        self._connection = connection

    def is_waited_for(self) -> bool:
        """Return whether a session waits for a lock."""
        return self.waiting() > 0

    def waiting(self) -> int:
        """Return how many sessions wait for a lock."""
        query = "SELECT count(*) FROM pg_stat_activity WHERE wait_event_type = 'Lock'"
        return int(self._connection.execute(query).fetchone()[0])


@contextmanager
def hanging(url: str) -> Iterator[Hang]:
    """Let each write hang, during a block."""
    with connected(url) as connection, connected(url) as watching:
        connection.execute("BEGIN")
        connection.execute("SELECT * FROM meta FOR UPDATE")
        yield Hang(watching)
        connection.execute("ROLLBACK")


class Gateway:
    """A lease and the store under it, in this process."""

    def __init__(self, url: str, name: str) -> None:
        self.name, self.url = name, url
        self.leases = LeaseDatabase(address.parse(url), name, host="127.0.0.1", port=1)
        self.outcomes: list[Outcome] = []
        try:
            self.join()
        except BaseException:
            self.leases.close()
            raise

    def join(self, replaced: Eviction | None = None) -> None:
        """Begin a lease, and a store under it."""
        row = self.asks(Join(self.name, replaced)).row
        if not row.epoch:  # an earlier attempt was carried out, and only its answer came late
            (own,) = (each for each in row.rivals if each.name == self.name)
            row = self.asks(Join(self.name, Eviction(own.name, own.epoch, own.renewals))).row
        self.epoch = row.epoch
        assert self.epoch
        self.open()

    def asks(self, request: Request) -> Answer:
        """Ask for a lease, and again after no answer in time, as a gateway does."""
        is_away = bool(self.leases.late)
        for _ in range(PATIENT):
            with suppress(PostgresError):
                if is_away:
                    self.leases.connect()
                return self.leases.execute(request)
            is_away = True
        self.leases.connect()
        return self.leases.execute(request)

    def open(self, url: str | None = None, *, wall_offset: float = OFFSET) -> None:
        self.through = 0
        self.store = FleetStore(
            address.parse(url or self.url),
            self.name,
            self.epoch,
            wall_offset=lambda: wall_offset,
            retention=FOR_EVER,
        )

    def evict(self, other: "Gateway") -> None:
        """End the lease of another gateway."""
        self.evict_named(other.name)

    def evict_named(self, name: str) -> None:
        """End the lease of a gateway, which may be another process."""
        answer = self.asks(Renew(self.name, self.epoch))
        (row,) = (each for each in answer.row.rivals if each.name == name)
        rival = Eviction(row.name, row.epoch, row.renewals)
        self.asks(Evict(Renew(self.name, self.epoch), rival))

    def next(self, kind: type[Kind]) -> Kind:
        """Return the next outcome of a kind."""
        end = time.monotonic() + PATIENCE
        while True:
            for number, outcome in enumerate(self.outcomes):
                if isinstance(outcome, kind):
                    del self.outcomes[number]
                    return outcome
            assert time.monotonic() < end, f"no {kind.__name__}: {self.outcomes}"
            fd = self.store.fileno()
            assert fd is not None
            select.select([fd], [], [], 0.1)
            self.outcomes += self.store.take_outcomes()

    def kept(self, through: int) -> None:
        """Wait until so many events are kept."""
        while self.through < through:
            self.through = self.next(Committed).through

    def close(self) -> None:
        self.store.close()
        self.leases.close()


@contextmanager
def gateways(url: str, *names: str) -> Iterator[list[Gateway]]:
    found = [Gateway(url, name) for name in names]
    try:
        yield found
    finally:
        for each in found:
            each.close()


@contextmanager
def away(postgres: PostgresServer, *gateways: Gateway) -> Iterator[None]:
    """Let the database be away during a block."""
    postgres.stop()
    yield
    postgres.start()
    for each in gateways:
        each.leases.connect()


def of_vehicle(number: int, vehicle: int) -> TaskSubmitted:
    return submitted(number, vehicle=vehicle)


def ids_in(url: str) -> list[int]:
    """Return the ids of all tasks, in the order of their submission."""
    with connected(url) as connection:
        return [row[0] for row in connection.execute("SELECT id FROM tasks ORDER BY number")]
