"""This server as a gateway of a fleet: its lease, and its part of the fleet's store.

Both last for one lease. When the fleet has ended that, ``serve`` begins again with nothing.
"""

import logging
import select
import time
from collections.abc import Iterator, Mapping
from contextlib import closing
from math import inf

from mav_tasks.basics.clock import boot_time
from mav_tasks.basics.errors import StoreError
from mav_tasks.config.settings import Gateway as GatewaySettings
from mav_tasks.config.settings import Retention
from mav_tasks.engine.inputs import FleetChanged, LeaseChanged, ParametersChanged, VehiclesGone
from mav_tasks.engine.snapshot import Reach
from mav_tasks.fleet.io.carrier import Carrier
from mav_tasks.fleet.io.fleet_link import FleetLink
from mav_tasks.fleet.io.keeper import Holders, Keeper, News, Parameters, Trouble
from mav_tasks.fleet.io.own_address import own_address
from mav_tasks.fleet.lease import Permit
from mav_tasks.fleet.member import Change
from mav_tasks.fleet.standing import MAY_STOP, Effect, Standing
from mav_tasks.store.postgres.address import Address, parse
from mav_tasks.store.postgres.failures import PostgresError, failure
from mav_tasks.store.postgres.fleet_store import FleetStore
from mav_tasks.store.postgres.session import Session
from mav_tasks.store.postgres.writable import check_writable

log = logging.getLogger("mav_tasks")

JOIN_LIMIT = 10.0  # s; a lease of an earlier process with this name ends within two


class Gateway:
    """A lease and the store under it; ``take`` returns what the engine must know of the lease."""

    def __init__(
        self, place: str, settings: GatewaySettings, retention: Retention, *, system_id: int
    ) -> None:
        """Join the fleet whose database ``place`` names; raise StoreError if that fails.

        ``system_id``: with which this gateway sends.
        """
        where = parse(place)
        host = settings.address or own_address(where)
        self.name = settings.name
        self._carrier: Carrier | None = None
        self._early: list[News] = []  # that came before the engine was there
        self._expected: frozenset[int] = frozenset()  # tasks that the store was asked about
        self._ours: frozenset[int] = frozenset()  # vehicles that the engine had
        self._going: dict[int, str] = {}  # that it was asked to forget, and who hears them
        self._gone: frozenset[int] = frozenset()  # that it has forgotten
        self._keeper = Keeper(where, settings.name, host=host, system_id=system_id)
        try:
            self._await_lease()
            self.store = FleetStore(
                where,
                settings.name,
                self._keeper.epoch,
                wall_offset=lambda: time.time() - boot_time(),
                retention=retention,
            )
            #: to the other gateways
            self.link = FleetLink(self._begin_carrier(where))
        except BaseException:
            self.close()
            raise
        #: whether the fleet has ended this lease
        self.is_over = False

    def __repr__(self) -> str:
        return f"Gateway({self._keeper!r})"

    def fileno(self) -> int | None:
        """Return the descriptor that is readable while ``take`` has something."""
        return self._keeper.fileno()

    def hear(self, reach: Reach) -> None:
        """Take which vehicles are heard: the gateway gets those that no other one has.

        What the engine was asked to forget, and has forgotten, is free.
        """
        self._keeper.hear(reach.heard, reach.strays)
        forgotten = frozenset(self._going.keys() - reach.ours)
        for vehicle in sorted(forgotten):
            log.warning(
                "gateway %s does not hear rover %s any more: gateway %s, which hears it, gets it",
                self.name,
                vehicle,
                self._going[vehicle],
            )
        self._ours, self._going = reach.ours, {}
        if forgotten:
            self._gone |= forgotten
            self._keeper.free(forgotten)

    def expect(self, tasks: frozenset[int]) -> None:
        """Ask the store about tasks of other gateways, if this is another object than before."""
        if tasks is not self._expected:
            self._expected = tasks
            self.store.watch_tasks(tasks)

    def take(self) -> Iterator[LeaseChanged | FleetChanged | ParametersChanged | VehiclesGone]:
        """Yield what has changed, and ask for the data of vehicles that this gateway has got."""
        early, self._early = self._early, []
        for news in (*early, *self._keeper.take()):
            match news:
                case Permit():
                    yield _changed(news)
                case Holders(pairs=pairs):
                    yield FleetChanged(pairs)
                case Parameters(pairs=pairs):
                    yield ParametersChanged(pairs)
                case Change(effects=effects, got=got, lets_go=lets_go):
                    if got:
                        self._gone -= got
                        log.info("gateway %s has got %s", self.name, _named(got))
                        self.store.load_vehicles(got)
                    self._tell(effects)
                    yield from self._let_go(dict(lets_go))
                case Trouble(words=None):
                    log.warning("gateway %s reaches the fleet's database again", self.name)
                case Trouble(words=words):
                    log.error("gateway %s: the fleet's database: %s", self.name, words)

    def close(self) -> None:
        """Leave the fleet; close the store before."""
        if self._carrier is not None:
            self._carrier.close()
        self._keeper.close()

    def _begin_carrier(self, where: Address) -> Carrier:
        self._carrier = Carrier(where, self.name)
        return self._carrier

    def _let_go(self, hearers: Mapping[int, str]) -> Iterator[VehiclesGone]:
        vehicles = tuple(sorted(hearers.keys() & self._ours - self._gone))
        if vehicles:
            self._going |= {vehicle: hearers[vehicle] for vehicle in vehicles}
            yield VehiclesGone(vehicles)

    def _tell(self, effects: tuple[Effect, ...]) -> None:
        if Effect.STOP in effects:
            log.error(
                "gateway %s cannot renew its lease: its rovers are stopped, and another gateway"
                " may get them",
                self.name,
            )
        if Effect.RESUME in effects:
            log.warning("gateway %s has renewed its lease: its tasks go on", self.name)
        if Effect.DROP in effects:
            self.is_over = True

    def _await_lease(self) -> None:
        """Wait for the lease, and say what it takes so long; raise StoreError."""
        end = time.monotonic() + JOIN_LIMIT
        why = "perhaps another process has the name: end it, or choose another --gateway NAME"
        while not self._keeper.epoch:
            fd = self._keeper.fileno()
            left = end - time.monotonic()
            if fd is None or left <= 0:
                raise StoreError(f"gateway {self.name}: no lease within {JOIN_LIMIT:.0f} s: {why}")
            select.select([fd], [], [], left)
            for news in self._keeper.take():
                if isinstance(news, Trouble) and news.words is not None:
                    why = f"the fleet's database: {news.words}"
                    waits = "gateway %s waits for its lease, %.0f s at most: %s"
                    log.warning(waits, self.name, max(0.0, end - time.monotonic()), why)
                else:
                    self._early.append(news)


def check_database(place: str, name: str) -> None:
    """Raise StoreError if a gateway cannot use the fleet's database now."""
    where = parse(place)
    try:
        with closing(Session(where, purpose=f"gateway {name} begins")) as session:
            check_writable(session)
    except PostgresError as error:
        raise StoreError(f"store {where.shown}: {failure(error) or error}") from error


def _changed(permit: Permit) -> LeaseChanged:
    is_holder, may_stop = permit.standing is Standing.HOLDER, permit.standing in MAY_STOP
    return LeaseChanged(
        permit.trusted_until if is_holder else -inf, permit.term_end if may_stop else -inf
    )


def _named(vehicles: frozenset[int]) -> str:
    names = ", ".join(map(str, sorted(vehicles)))
    return f"rover {names}" if len(vehicles) == 1 else f"rovers {names}"
