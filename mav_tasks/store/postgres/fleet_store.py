"""The store of a fleet in PostgreSQL, as one gateway has it for as long as its lease lasts."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace

from mav_tasks.config.settings import Retention
from mav_tasks.engine.inputs import HaltsKept, IdsGranted, StoreFailed
from mav_tasks.store import reading
from mav_tasks.store.base import Evicted, Outcome
from mav_tasks.store.durable import CLOSE_LIMIT, DurableStore
from mav_tasks.store.halt_record import HaltRecord, Word
from mav_tasks.store.postgres.address import Address
from mav_tasks.store.postgres.fleet_database import FleetDatabase
from mav_tasks.store.postgres.fleet_loader import BLOCK, FleetLoader
from mav_tasks.store.postgres.local_path import local_path
from mav_tasks.store.postgres.task_watch import TaskWatch
from mav_tasks.tasks.events import Event, TaskSubmitted
from mav_tasks.tasks.restored import Restored

LOADER_LIMIT = 0.5  # s at the end


class FleetStore(DurableStore):
    """Implements ``Store``: each write fails once the lease has ended, and ``Evicted`` tells it.

    ``IdsGranted`` comes soon after the constructor, and whenever few ids are left. The constructor
    raises StoreError, with a text of one line, if the database cannot be used.
    """

    def __init__(
        self,
        where: Address,
        gateway: str,
        epoch: int,
        *,
        wall_offset: Callable[[], float],
        retention: Retention | None = None,
    ) -> None:
        name = where.shown
        with ExitStack() as begun:
            database = FleetDatabase(where, gateway, epoch)
            begun.callback(database.close, utc=None)
            path = local_path(f"{database.name}-{gateway}", database.fleet, name=name)
            record = HaltRecord(path, name=name)
            begun.callback(record.close)
            record.belong_to(database.fleet)
            database.begin()
            release = begun.pop_all().close
        self._fleet, self._gateway = database, gateway
        self._is_told = False  # that the lease has ended
        self._left = 0  # task ids, granted and not used
        super().__init__(
            database,
            record,
            name=name,
            wall_offset=wall_offset,
            retention=retention,
            release=release,
        )
        self._loader = FleetLoader(where, gateway, epoch, self._mail, wall_offset=wall_offset)
        self._watch = TaskWatch(where, gateway, self._mail)
        self._is_asked = False
        self._ask_for_ids()

    def load(self) -> Restored:
        """Return what belongs to no vehicle; raise StoreError."""
        with closing(self._fleet.reader()) as reader:
            restored = reading.read_restored(
                reader,
                offset=self._wall_offset(),
                ended_well=True,
                idle=0.0,
                vehicles=frozenset(),
            )
        return replace(restored, gateway=self._gateway)

    def load_vehicles(self, vehicles: frozenset[int]) -> None:
        """Ask for everything about vehicles; ``VehiclesTaken`` is the answer. Never blocks."""
        self._loader.ask(vehicles)

    def watch_tasks(self, ids: frozenset[int]) -> None:
        """Ask how tasks stand, and for changes from now on; these alone. Never blocks.

        ``TasksElsewhere`` are the answers: for each task after each call, and when it ends.
        """
        self._watch.ask(ids)

    def append(self, events: Sequence[Event]) -> None:
        """Queue events to be made durable, without blocking; raise ValueError after ``close``."""
        super().append(events)
        self._left -= sum(isinstance(event, TaskSubmitted) for event in events)
        self._ask_for_ids()

    def take_outcomes(self) -> list[Outcome]:
        """Return the outcomes since the last call; raise an exception of the store's threads."""
        outcomes: list[Outcome] = []
        for outcome in super().take_outcomes():
            if isinstance(outcome, HaltsKept):
                continue  # on this machine, where the gateway that gets the vehicle cannot read it
            if isinstance(outcome, StoreFailed) and self._fleet.is_replaced:
                outcome = Evicted(outcome.text)
            if isinstance(outcome, IdsGranted):
                self._left += outcome.count
                self._is_asked = False
                self._ask_for_ids()
            if isinstance(outcome, Evicted):
                if self._is_told:
                    continue
                self._is_told = True
            outcomes.append(outcome)
        return outcomes

    def close(self) -> None:
        """Write the remaining events, and end the sessions."""
        if self._is_open:
            self._loader.close(within=LOADER_LIMIT)
            self._watch.close(within=LOADER_LIMIT)
        super().close()

    def _ask_for_ids(self) -> None:
        if self._left < BLOCK // 2 and not self._is_asked:
            self._is_asked = True
            self._loader.ask(None)

    def _close_limit(self) -> float:
        return 0.0 if self._fleet.is_replaced else CLOSE_LIMIT

    def _missing(self, words: list[Word]) -> list[Word]:
        return self._fleet.missing(words)
