"""A gateway's right to write the store of its fleet: as long as its lease has the same epoch.

The tables of leases (``fleet/io``) say who is in the fleet. Each transaction begins with ``fence``,
which fails unless the gateway's row has this epoch. It locks the row against the end of the lease,
which takes the row for itself first, but not against renewals, so that a write that hangs does not
cost the lease. So once a lease has ended, a transaction under it has either been committed before
or never will be.

A session that this gateway has lost may still commit its last batch, after another session has
asked what is stored. So a batch says after which event it comes, and fails at any other place.
"""

from mav_tasks.store.holder import Replaced, words_for
from mav_tasks.store.postgres.failures import PostgresError
from mav_tasks.store.postgres.ownership import Ownership, holder_if_any
from mav_tasks.store.postgres.session import Limits, Session

#: a gateway that stops in a transaction keeps others from writing, and its lease from ending: the
#: database cannot see that while its machine answers
LIMITS = Limits(in_transaction=1.0, transaction=2.0)

EVICTED = "the fleet has ended the lease of gateway {}: another gateway may have its rovers"


class GatewayOwnership(Ownership):
    """The fence of one gateway in one epoch. The fleet's lock is shared by all gateways.

    Events are counted for each gateway, over its lives: ``written`` is the number of the last one.
    """

    table = "gateway_writes"

    def __init__(self, name: str, epoch: int) -> None:
        super().__init__(is_shared=True)
        self.name, self.epoch = name, epoch
        self.number = 0

    def __repr__(self) -> str:
        return f"GatewayOwnership({self.name}, epoch {self.epoch})"

    def begin(self, session: Session) -> None:
        """Begin to write; raise Replaced if the lease has ended."""
        self.resume(session)
        session.execute(
            "INSERT INTO gateway_writes (gateway, epoch, written) VALUES (?, 0, 0)"
            " ON CONFLICT DO NOTHING",
            (self.number,),
        )

    def resume(self, session: Session) -> None:
        """Go on in a new session; raise Replaced if the lease has ended."""
        query = "SELECT number FROM gateways WHERE name = ? AND epoch = ?"
        found = session.execute(query, (self.name, self.epoch)).fetchone()
        if found is None:
            raise self._replaced(session)
        self.number = found[0]
        self._enter(session, self.epoch)

    def fence(self, session: Session) -> None:
        """Make the transaction fail if the lease has ended."""
        session.execute(
            "UPDATE gateway_writes SET epoch = (SELECT CASE WHEN epoch = ? THEN epoch END"
            " FROM gateways WHERE number = ? FOR KEY SHARE) WHERE gateway = ?",
            (self.epoch, self.number, self.number),
        )

    def wrote(self, session: Session, before: int, last: int) -> None:
        """Note, in a batch's transaction, the number of its last event.

        Make it fail unless ``before`` is the number of the last one that is stored.
        """
        session.execute(
            "UPDATE gateway_writes SET written = CASE WHEN written = ? THEN ?::bigint END"
            " WHERE gateway = ?",
            (before, last, self.number),
        )

    def failure_of(self, session: Session, error: PostgresError) -> Exception:
        """Return Replaced if an error is the fence's, another one if it is that of ``wrote``."""
        cause = super().failure_of(session, error)
        if isinstance(cause, Replaced) and error.column == "written":
            return PostgresError("a lost session of this gateway has stored events since")
        return cause

    def written(self, session: Session) -> int:
        """Return the number of the last event that this gateway has stored."""
        query = "SELECT written FROM gateway_writes WHERE gateway = ?"
        found = session.execute(query, (self.number,)).fetchone()
        if found is None:
            raise PostgresError("a table has lost its row")
        return int(found[0])

    def _in_use(self, session: Session) -> Exception:
        return PostgresError(f"in use by {words_for(holder_if_any(session))}")

    def _replaced(self, session: Session) -> Exception:  # noqa: ARG002  nobody in particular
        return Replaced(EVICTED.format(self.name))
