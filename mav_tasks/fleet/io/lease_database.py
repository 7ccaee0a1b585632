"""Leases in PostgreSQL: carries out each request of a gateway in one transaction and round trip.

``Member`` says what to ask; each answer equals that of ``tests/kit/gateways/database.py``.

The first statement of a change locks the rows of the gateways that it is about, in one order for
all. What follows sees what was committed until then, so that a renewal and an eviction of one
gateway exclude each other, and two gateways that evict each other do not wait for each other.

A session has the advisory lock of its gateway's name. So a second process of that name is refused;
and what an earlier session of this process has asked is over before a new one can ask anything.
"""

import os
import socket
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from mav_tasks.basics.errors import StoreError
from mav_tasks.fleet.io.endpoint import Endpoint
from mav_tasks.fleet.member import Evict, Free, Join, Renew, Request, Row, Take
from mav_tasks.fleet.rivals import Rival
from mav_tasks.store.postgres import schema
from mav_tasks.store.postgres.address import Address
from mav_tasks.store.postgres.failures import PostgresError, failure, is_temporary
from mav_tasks.store.postgres.rights import check_rights
from mav_tasks.store.postgres.session import Found, Limits, Session
from mav_tasks.store.postgres.session_lock import LOCK_NOT_AVAILABLE, SessionLock
from mav_tasks.store.postgres.writable import check_writable

NAME_LOCK = 0x4D565454  # "MVTT"; above the gateway's number

#: well below the time for which a renewal is trusted (``Terms``): two may fail
LIMITS = Limits(answer=0.3, statement=0.25, lock=0.2, in_transaction=0.5, sending=0.4)


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to a request, and what else was read with it.

    ``endpoints``: where the gateways in it answer pings, by name. ``parameters``: those that
    clients have set at any gateway; None: no gateway is in the fleet, and they were not read.
    """

    row: Row
    endpoints: Mapping[str, Endpoint]
    parameters: Mapping[str, float] | None = None


class LeaseDatabase:
    """The sessions of one gateway; used by one thread at a time. Methods raise PostgresError.

    After any error the session is over, and ``connect`` begins a new one.
    """

    def __init__(
        self,
        address: Address,
        name: str,
        *,
        host: str,
        port: int,
        system_id: int = 0,
        limits: Limits = LIMITS,
    ) -> None:
        """Make the tables if they are missing, and take the name.

        ``host`` and ``port`` are where this process answers pings. ``system_id`` is the one with
        which it sends, 0: unknown. Raise StoreError, with a line that names the process which has
        the name, or a gateway that runs with another system id. If the database is only too slow
        for a lease, there is no session yet, and ``late`` says why.
        """
        self._address = address
        self.name = name
        self._host, self._port = host, port
        self._system_id = system_id
        self._limits = limits
        self._session: Session | None = None
        self._lock: SessionLock | None = None
        self._number = 0
        self.late = ""
        try:
            self.secret = self._prepare()
            try:
                self.connect()
            except PostgresError as error:
                if not is_temporary(error):
                    raise
                self.late = failure(error) or str(error)
        except PostgresError as error:
            words = failure(error) or str(error)
            raise StoreError(f"store {address.shown}: {words}") from error

    def __repr__(self) -> str:
        return f"LeaseDatabase({self.name}, {self._session})"

    def connect(self) -> None:
        """Begin a session, which has the lock of the name; end the earlier one."""
        self.close()
        session = Session(self._address, purpose=f"gateway {self.name}", limits=self._limits)
        try:
            check_writable(session)
            if not self._number:  # the first time
                self._check_system_id(session)
            self._take_name(session)
        except BaseException:
            session.close()
            raise
        self._session = session

    def execute(self, request: Request) -> Answer:
        """Carry out a request, as a whole or not at all."""
        assert self._session is not None
        try:
            with self._session.batch() as found:
                self._queue(self._session, request)
        except PostgresError:
            self.close()
            raise
        granted, rows = found[-2].fetchone(), found[-1]
        return self._answer(granted[0] if granted else 0, rows)

    def close(self) -> None:
        """End the session; may be called again."""
        if self._session is not None:
            self._session.close()
            self._session = None

    def _prepare(self) -> bytes:
        """Make the tables and this gateway's row; return the fleet's secret."""
        session = Session(self._address, purpose=f"gateway {self.name}")
        try:
            check_writable(session)
            check_rights(session)
            schema.migrate(session)
            ((secret,),) = session.execute("SELECT secret FROM gateway_secret").fetchall()
            return str(secret).encode()
        finally:
            session.close()

    def _check_system_id(self, session: Session) -> None:
        """Raise PostgresError if a gateway that runs has another system id.

        A rover knows its ground station by that id: it may take a second one for a stranger, and
        its signatures fence gateways by it.
        """
        found = session.execute(_OTHER_ID, (NAME_LOCK, self.name, self._system_id)).fetchone()
        if found is not None and self._system_id:
            other, theirs = found
            raise PostgresError(
                f"identity.system_id is {self._system_id} here and {theirs} at gateway {other}:"
                " all gateways of a fleet need the same one"
            )

    def _take_name(self, session: Session) -> None:
        session.execute(
            "INSERT INTO gateways (name) SELECT ?::text"
            " WHERE NOT EXISTS (SELECT 1 FROM gateways WHERE name = ?) ON CONFLICT DO NOTHING",
            (self.name, self.name),
        )
        query = "SELECT number, machine, pid, since, system_id FROM gateways WHERE name = ?"
        ((number, machine, pid, since, said),) = session.execute(query, (self.name,)).fetchall()
        if self._lock is None or number != self._number:
            self._number, self._lock = number, SessionLock(NAME_LOCK << 32 | number)
        try:
            self._lock.take(session)
        except PostgresError as error:
            if error.sqlstate != LOCK_NOT_AVAILABLE:
                raise
            if (machine, pid) == (socket.gethostname(), os.getpid()):
                raise PostgresError("the database has not ended the lost session yet") from error
            when = time.strftime("%Y-%m-%d %H:%M:%SZ", time.gmtime(since))
            words = f"on {machine}, pid {pid}, since {when}" if pid else "which has just begun"
            raise PostgresError(
                f"the gateway name {self.name} is in use by a process {words}:"
                " end that one, or choose another name"
            ) from error
        if said != self._system_id:
            session.execute(
                "UPDATE gateways SET system_id = ? WHERE number = ?", (self._system_id, number)
            )

    def _queue(self, session: Session, request: Request) -> None:
        """Queue the statements of a request.

        The last two find the epoch that was granted, if any, and all gateways in the fleet.
        """
        if isinstance(request, Join):
            self._queue_join(session, request)
        else:
            by = request if isinstance(request, Renew) else request.by
            self._queue_change(session, request, by.epoch)
        session.execute(_READ, (NAME_LOCK,))

    def _queue_join(self, session: Session, request: Join) -> None:
        replaced = request.replaced
        session.execute(_LOCK, (self.name, self.name))
        session.execute(
            _JOIN,
            (
                self._host,
                self._port,
                socket.gethostname(),
                os.getpid(),
                time.time(),
                self._number,
                replaced.epoch if replaced else 0,
                replaced.renewals if replaced else 0,
            ),
        )

    def _queue_change(
        self, session: Session, request: Renew | Evict | Take | Free, epoch: int
    ) -> None:
        me = (self._number, epoch)
        match request:
            case Renew(hears=hears):
                # a crash of the database may forget it, and then all others count a whole term anew
                session.execute("SELECT set_config('synchronous_commit', 'off', true)")
                session.execute(_RENEW, (_array(hears), *me))
                return
            case Evict(_, rival):
                session.execute(_LOCK, (self.name, rival.name))
                session.execute(_EVICT, (rival.name, rival.epoch, rival.renewals, *me))
            case Take(_, vehicles):
                session.execute(_LOCK, (self.name, self.name))
                session.execute(_TAKE, (_array(vehicles), *me))
            case Free(_, vehicle):
                session.execute(_LOCK, (self.name, self.name))
                session.execute(_FREE, (vehicle, *me))
        session.execute(_ASK, me)

    def _answer(self, granted: int, rows: Found) -> Answer:
        holds: frozenset[int] = frozenset()
        rivals: list[Rival] = []
        endpoints: dict[str, Endpoint] = {}
        parameters: Mapping[str, float] | None = None
        for row in rows:
            name, epoch, renewals, in_session, vehicles, hears, host, port, parameters = row
            if epoch == granted:
                holds = frozenset(vehicles)
            else:
                held, heard = frozenset(vehicles), frozenset(hears)
                rivals.append(Rival(name, epoch, renewals, in_session, held, heard))
                endpoints[name] = Endpoint(epoch, host, port)
        return Answer(Row(granted, holds, tuple(rivals)), endpoints, parameters)


def _array(vehicles: Iterable[int]) -> str:
    return f"{{{','.join(map(str, sorted(vehicles)))}}}"


_LOCK = "SELECT 1 FROM gateways WHERE name IN (?, ?) ORDER BY number FOR UPDATE"

#: free the vehicles of a gateway in ``ended``; in the order in which _TAKE locks them, too
_FREE_ALL = """
theirs AS (
  SELECT vehicle FROM holdings JOIN ended ON gateway = ended.number ORDER BY vehicle
  FOR UPDATE OF holdings
), freed AS (
  UPDATE holdings SET gateway = NULL FROM theirs WHERE holdings.vehicle = theirs.vehicle
)
SELECT epoch FROM ended
"""
#: epoch 0 is nobody's: a row that was evicted, or never joined
_JOIN = f"""
WITH ended AS (
  UPDATE gateways SET epoch = nextval('gateway_epochs'), renewals = 0, backend = pg_backend_pid(),
    hears = '{{}}', host = ?, port = ?, machine = ?, pid = ?, since = ?
  WHERE number = ? AND (epoch = 0 OR (epoch, renewals) = (?, ?))
  RETURNING number, epoch
), {_FREE_ALL}"""
_EVICT = f"""
WITH ended AS (
  UPDATE gateways SET epoch = 0 WHERE name = ? AND epoch = ? AND renewals = ?
    AND EXISTS (SELECT FROM gateways WHERE number = ? AND epoch = ?)
  RETURNING number, epoch
), {_FREE_ALL}"""
_RENEW = (
    "UPDATE gateways SET renewals = renewals + 1, hears = ?::bigint[],"
    " backend = pg_backend_pid() WHERE number = ? AND epoch = ? RETURNING epoch"
)
_ASK = (
    "UPDATE gateways SET backend = pg_backend_pid() WHERE number = ? AND epoch = ? RETURNING epoch"
)
_TAKE = """
INSERT INTO holdings (vehicle, gateway, number)
SELECT vehicle, gateways.number, 1 FROM gateways, unnest(?::bigint[]) AS vehicle
WHERE gateways.number = ? AND epoch = ? ORDER BY vehicle
ON CONFLICT (vehicle) DO UPDATE SET gateway = excluded.gateway, number = holdings.number + 1
WHERE holdings.gateway IS NULL
"""
_FREE = """
UPDATE holdings SET gateway = NULL FROM gateways
WHERE vehicle = ? AND gateway = gateways.number AND gateways.number = ? AND epoch = ?
"""
#: of gateways that run: a session has the lock of each one's name
_OTHER_ID = """
SELECT name, system_id FROM gateways JOIN pg_locks ON objid = gateways.number::oid
WHERE locktype = 'advisory' AND granted AND objsubid = 1 AND classid = ?
  AND database = (SELECT oid FROM pg_database WHERE datname = current_database())
  AND name <> ? AND system_id NOT IN (0, ?)
ORDER BY number LIMIT 1
"""
_READ = """
SELECT name, epoch, renewals, pid_of_lock IS NOT NULL,
  ARRAY(SELECT vehicle FROM holdings WHERE gateway = gateways.number), hears, host, port,
  (SELECT coalesce(json_object_agg(name, value ORDER BY name), '{}') FROM parameters
   WHERE value IS NOT NULL)
FROM gateways LEFT JOIN (
  SELECT objid, pid AS pid_of_lock FROM pg_locks
  WHERE locktype = 'advisory' AND granted AND objsubid = 1 AND classid = ?
    AND database = (SELECT oid FROM pg_database WHERE datname = current_database())
) AS locks ON objid = gateways.number::oid AND pid_of_lock = backend
WHERE epoch <> 0 ORDER BY gateways.number
"""
