"""The thread that gets a gateway what it needs from its fleet's store: task ids, and vehicles.

It retries until the database answers, or the lease has ended.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from queue import SimpleQueue
from threading import Event, Thread

from mav_tasks.basics.clock import boot_time
from mav_tasks.basics.errors import StoreError
from mav_tasks.basics.mailbox import Mailbox
from mav_tasks.engine.inputs import IdsGranted, StoreFailed, VehiclesTaken
from mav_tasks.store.base import Evicted, Outcome
from mav_tasks.store.holder import Replaced
from mav_tasks.store.postgres.address import Address
from mav_tasks.store.postgres.failures import PostgresError, failure
from mav_tasks.store.postgres.fleet_database import UTC
from mav_tasks.store.postgres.gateway_ownership import LIMITS, GatewayOwnership
from mav_tasks.store.postgres.reader import PostgresReader
from mav_tasks.store.postgres.session import Found, Session
from mav_tasks.store.reading import read_restored
from mav_tasks.tasks.fleet import DECAY, MOST_LEAD, STEP
from mav_tasks.tasks.lifecycle import RUNNING
from mav_tasks.tasks.task import MAX_TASK_ID

BLOCK = 1_000  # task ids that a gateway gets at once
RETRY = 0.25  # s between two attempts
REPORT = 5.0  # s between two reports of a lasting failure

#: the id after the block, or 1 if the block reaches the last id
_RESERVE = (
    "UPDATE meta SET next_id = CASE WHEN next_id + ?::bigint > ?::bigint THEN 1"
    " ELSE next_id + ?::bigint END"
)
_LEAD = (
    # a clock that was set back must not make it longer: at the most it is no fence any more
    "UPDATE holdings SET lead = least(?,"
    " greatest(0, lead - ?::float8 * greatest(0, ? - lead_utc)) + ?),"
    " lead_utc = ? WHERE vehicle = ANY(?::bigint[]) RETURNING lead"
)

#: by the clock of the database, as it was written: those of gateways may have been set since
_IDLE = f"SELECT greatest(0, coalesce({UTC} - last_write, 0)) FROM meta"

Job = frozenset[int] | None  # vehicles to load; None: task ids


class FleetLoader:
    """Puts ``IdsGranted`` and ``VehiclesTaken`` into a mailbox."""

    def __init__(
        self,
        address: Address,
        gateway: str,
        epoch: int,
        mail: Mailbox[Outcome],
        *,
        wall_offset: Callable[[], float],
    ) -> None:
        self._address = address
        self._gateway, self._epoch = gateway, epoch
        self._mail = mail
        self._wall_offset = wall_offset
        self._jobs: SimpleQueue[Job | Event] = SimpleQueue()
        self._is_closing = Event()
        self._report_at = 0.0
        self._thread = Thread(target=self._run, name="fleet loader", daemon=True)
        self._thread.start()

    def __repr__(self) -> str:
        return f"FleetLoader({self._gateway}, epoch {self._epoch})"

    def ask(self, job: Job) -> None:
        """Get something; never blocks."""
        self._jobs.put(job)

    def close(self, *, within: float) -> None:
        """End the thread after its present attempt."""
        self._is_closing.set()
        self._jobs.put(self._is_closing)
        self._thread.join(within)

    def _run(self) -> None:
        try:
            while not isinstance(job := self._jobs.get(), Event):
                while not self._is_done(job):
                    if self._is_closing.wait(RETRY):
                        return
        except Replaced as end:
            self._mail.put(Evicted(f"store {self._address.shown}: {end}"))
        except Exception as mistake:  # noqa: BLE001 - a bug of ours: raised in the loop
            self._mail.put_mistake(mistake)

    def _is_done(self, job: Job) -> bool:
        try:
            self._mail.put(self._ids() if job is None else self._loaded(job))
        except (PostgresError, StoreError) as error:
            words = failure(error) if isinstance(error, PostgresError) else str(error)
            if words is None:
                raise
            now = time.monotonic()
            if now >= self._report_at:
                self._report_at = now + REPORT
                self._mail.put(StoreFailed(f"store {self._address.shown}: {words}"))
            return False
        return True

    def _ids(self) -> IdsGranted:
        with self._in_transaction("ids") as (session, found):
            session.execute("SELECT next_id FROM meta FOR UPDATE")  # what follows sees this one
            session.execute(_RESERVE, (BLOCK, MAX_TASK_ID, BLOCK))
        ((first,),) = found[0]
        return IdsGranted(int(first), int(min(BLOCK, MAX_TASK_ID + 1 - first)))

    @contextmanager
    def _in_transaction(self, purpose: str) -> Iterator[tuple[Session, list[Found]]]:
        """Execute the block in a session of its own, unless the lease has ended.

        It is one round trip: other gateways wait for the locked rows. After the block the list has
        what each query in it has found.
        """
        lease = GatewayOwnership(self._gateway, self._epoch)
        purpose = f"gateway {self._gateway} {purpose}"
        session = Session(self._address, purpose=purpose, limits=LIMITS)
        try:
            lease.resume(session)
            with session.batch() as found:
                lease.fence(session)
                yield session, found
        except PostgresError as error:
            raise lease.failure_of(session, error) from error
        finally:
            session.close()

    def _loaded(self, vehicles: frozenset[int]) -> VehiclesTaken:
        offset, purpose = self._wall_offset(), f"gateway {self._gateway} load"
        with closing(PostgresReader(self._address, purpose=purpose)) as reader:
            ((idle,),) = reader.connection.execute(_IDLE).fetchall()
            restored = read_restored(
                reader, offset=offset, ended_well=True, idle=idle, vehicles=vehicles
            )
        was_running = any(task.state in RUNNING for task in restored.tasks)
        # last: an attempt that fails before must not move it
        lead = self._lead(vehicles)
        return VehiclesTaken(
            tuple(sorted(vehicles)),
            replace(restored, ended_well=not was_running, signing_lead=lead),
        )

    def _lead(self, vehicles: frozenset[int]) -> float:
        """Take the next lead of signatures for these vehicles, and return it."""
        utc = boot_time() + self._wall_offset()
        listed = ",".join(map(str, sorted(vehicles)))
        with self._in_transaction("lead") as (session, found):
            session.execute(_LEAD, (MOST_LEAD, DECAY, utc, STEP, utc, f"{{{listed}}}"))
        return max((float(lead) for (lead,) in found[0]), default=0.0)
