"""The database of a fleet, which several gateways write.

Each gateway counts its own events. Their numbers in the journal are given by the database, under
the lock of the row of ``meta``, which a transaction keeps until it is committed: so the numbers of
all gateways are in the order of the commits, and a reader that has seen one has seen all before.
"""

from collections.abc import Sequence

from mav_tasks.basics.clock import boot_time
from mav_tasks.engine.inputs import NonceTaken
from mav_tasks.store.batch import Batch
from mav_tasks.store.batch_writing import find_format, write_rows
from mav_tasks.store.halt_record import Register, Word
from mav_tasks.store.postgres.address import Address
from mav_tasks.store.postgres.database import PostgresDatabase, inserts
from mav_tasks.store.postgres.dependencies import IS_EXPECTED, write_dependencies
from mav_tasks.store.postgres.fleet_nonces import claim, forget, refused
from mav_tasks.store.postgres.gateway_ownership import LIMITS, GatewayOwnership
from mav_tasks.store.retention import Trimmer

AT_WORK = 30.0  # s after the start; vehicles are loaded within some seconds
TRIM_LOCK = 0x4D565453_00000003  # of the gateway that deletes expired rows

#: the database's clock: one for all gateways, whose own may be set at any time
UTC = "extract(epoch FROM clock_timestamp())::float8"

#: to the number of a row in its gateway's count, for the number in the journal
_BASE = "current_setting('mav_tasks.base')::bigint + "


class FleetDatabase(PostgresDatabase):
    """Implements ``EventDatabase`` for one gateway under one lease."""

    _inserts = inserts(_BASE)

    def __init__(self, address: Address, gateway: str, epoch: int) -> None:
        self._lease = GatewayOwnership(gateway, epoch)
        self._began = boot_time()
        purpose = f"gateway {gateway} store"
        super().__init__(address, ownership=self._lease, purpose=purpose, limits=LIMITS)

    def begin(self) -> None:
        """Become a writer, and read how far this gateway has written."""
        with self._at_start():
            self._lease.begin(self._session)
            with self._session.transaction():
                self.format_id = find_format(self._session)
            self.last_number = self._stored()
            (self.last_write,) = self._meta("last_write")
            self.ended_well = True  # the tasks of each vehicle tell

    def write(self, batch: Batch, *, utc: float) -> None:
        """Make a batch durable, as a whole or not at all."""
        count = batch.last - batch.first + 1
        session = self._session
        with self._fenced():
            self._lease.wrote(session, self.last_number, batch.last)
            session.execute(
                f"UPDATE meta SET last_number = last_number + ?, last_write = {UTC}", (count,)
            )
            session.execute(
                "SELECT set_config('mav_tasks.base', (last_number - ?::bigint)::text, true)"
                " FROM meta",
                (batch.last,),
            )
            write_rows(session, batch, insert=self._insert)
            write_dependencies(session, batch)
            claim(session, batch, utc=utc)
        self.last_number = batch.last

    def refused(self, batch: Batch) -> list[NonceTaken]:
        """Return the submissions of a durable batch that another gateway's had come before."""
        with self._cause():
            return refused(self._session, batch)

    def trim(self, trimmer: Trimmer, *, utc: float) -> bool:
        """Delete some expired rows, unless another gateway is doing that.

        It also notes that the fleet is at work, if nothing was to be stored for long: queues that
        nobody has looked after for hours must not go on alone (``tasks/fleet.py``). That locks the
        row of ``meta``, for which every write waits, so it is a transaction of its own.
        """
        has_more = self._trim(trimmer, utc=utc)
        is_at_work = boot_time() - self._began >= AT_WORK  # not at the start, after hours
        if not has_more and is_at_work:
            with self._fenced():
                self._session.execute(f"UPDATE meta SET last_write = {UTC}")
        return has_more

    def _trim(self, trimmer: Trimmer, *, utc: float) -> bool:
        with self._cause(), self._session.transaction():
            self._lease.fence(self._session)
            query = "SELECT pg_try_advisory_xact_lock(?)"
            ((is_ours,),) = self._session.execute(query, (TRIM_LOCK,)).fetchall()
            if is_ours:
                forget(self._session)
            return bool(is_ours) and trimmer.step(self._session, utc=utc, kept=IS_EXPECTED)

    def close(self, *, utc: float | None) -> None:  # noqa: ARG002  others go on writing
        """End the session."""
        self._session.close()

    def missing(self, words: Sequence[Word]) -> list[Word]:
        """Return the words about vehicles that no gateway has now and that were not halted since.

        Another gateway may have had them since these words, and what it has stored is newer.
        """
        session = self._session
        held = {v for (v,) in session.execute("SELECT vehicle FROM holdings WHERE gateway > 0")}
        rows = session.execute("SELECT vehicle, coalesce(halt_epoch, 0) FROM vehicles")
        epochs = dict(rows.fetchall())
        told = {w.vehicle: w.value for w in words if w.register is Register.HALTS}
        return [
            word
            for word in words
            if word.vehicle not in held and told.get(word.vehicle, 0) > epochs.get(word.vehicle, 0)
        ]

    def _stored(self) -> int:
        return self._lease.written(self._session)
