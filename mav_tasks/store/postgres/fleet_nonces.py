"""The nonces of submissions to any vehicle, which are unique in a fleet.

A submission that names its vehicle comes to the gateway that has this one, which knows its nonces.
One to any vehicle may come to two gateways: its client repeats it at another one if the first does
not answer. So it is the database that decides: the batch that is committed first has the nonce. The
task of the other one is deleted in the transaction that would store it, so it never was one, and
its gateway learns that before the batch counts as durable: it has not acknowledged or begun it.

All batches of a fleet hold the lock of the row of ``meta`` until they are committed, so that each
one sees the nonces of those before.
"""

from mav_tasks.engine.inputs import NonceTaken
from mav_tasks.store.batch import Batch
from mav_tasks.store.codec import dumps
from mav_tasks.store.postgres.session import Session
from mav_tasks.tasks.deduplicator import NONCE_KEPT
from mav_tasks.tasks.lifecycle import TaskState

_ROWS = (
    "(SELECT r->>0 AS key, (r->>1)::integer AS system_id, (r->>2)::integer AS component_id,"
    " (r->>3)::bigint AS nonce, r->>4 AS payload, (r->>5)::bigint AS task_id"
    " FROM json_array_elements(?::json) AS r)"
)
_OVER = f"state >= {TaskState.COMPLETED:d}"
#: a nonce is free again when its task is long over (``SubmissionDeduplicator``), or was deleted
_CLAIM = (
    "INSERT INTO nonces (key, system_id, component_id, nonce, payload, task_id)"
    f" SELECT key, system_id, component_id, nonce, payload, task_id FROM {_ROWS} AS claimed"
    " ON CONFLICT (key, system_id, component_id, nonce)"
    " DO UPDATE SET payload = excluded.payload, task_id = excluded.task_id"
    " WHERE NOT EXISTS (SELECT FROM tasks WHERE tasks.id = nonces.task_id"
    f" AND NOT ({_OVER} AND changed_at < ?::double precision))"
)
_LOST = "SELECT task_id FROM nonces WHERE task_id = tasks.id"
_KEEP_SUBMISSIONS = (
    "INSERT INTO journal (number, utc, kind, task_id, vehicle, body)"
    " SELECT number, changed_at, 'TaskSubmitted', id, vehicle, submitted FROM tasks"
    f" WHERE id = ANY(?::bigint[]) AND NOT EXISTS ({_LOST})"
)
_DELETE = f"DELETE FROM tasks WHERE id = ANY(?::bigint[]) AND NOT EXISTS ({_LOST})"
_REFUSED = (
    f"SELECT claimed.task_id, nonces.task_id, nonces.payload FROM {_ROWS} AS claimed"
    " JOIN nonces USING (key, system_id, component_id, nonce)"
    " WHERE nonces.task_id <> claimed.task_id"
)


def claim(session: Session, batch: Batch, *, utc: float) -> None:
    """Claim the nonces of a batch in its transaction; delete the tasks that come too late."""
    if not batch.nonces:
        return
    session.execute(_CLAIM, (_rows(batch), utc - NONCE_KEPT))
    ids = f"{{{','.join(str(task_id) for _, task_id in batch.nonces.values())}}}"
    session.execute(_KEEP_SUBMISSIONS, (ids,))
    session.execute(_DELETE, (ids,))


def refused(session: Session, batch: Batch) -> list[NonceTaken]:
    """Return which submissions of a batch that is committed came too late, and the tasks before."""
    if not batch.nonces:
        return []
    found = session.execute(_REFUSED, (_rows(batch),)).fetchall()
    return [NonceTaken(int(ours), int(known), payload) for ours, known, payload in found]


def forget(session: Session) -> None:
    """Delete the nonces of tasks that are deleted, within a transaction."""
    session.execute(
        "DELETE FROM nonces WHERE NOT EXISTS (SELECT FROM tasks WHERE tasks.id = nonces.task_id)"
    )


def _rows(batch: Batch) -> str:
    return dumps([[*place, *of] for place, of in batch.nonces.items()])
