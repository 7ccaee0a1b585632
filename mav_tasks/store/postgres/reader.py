"""A session that only reads, beside the server that writes; a role that may only SELECT will do."""

from contextlib import AbstractContextManager

from mav_tasks.basics.errors import StoreError
from mav_tasks.store.postgres import schema
from mav_tasks.store.postgres.address import Address
from mav_tasks.store.postgres.failures import failure
from mav_tasks.store.postgres.session import READING, Session
from mav_tasks.store.postgres.writable import check_writable
from mav_tasks.store.reading import in_one_line


class PostgresReader:
    """Implements ``Reader``. The constructor raises StoreError."""

    task_key = "number"

    def __init__(self, address: Address, *, purpose: str = "read") -> None:
        """``purpose`` tells the server's operator what the session is for.

        A standby, which lags, will do for "read"; for any other purpose it is refused.
        """
        self.name = address.shown
        with in_one_line(self):
            self.connection = Session(address, purpose=purpose, limits=READING)
            try:
                if purpose != "read":
                    check_writable(self.connection)
                self.is_empty = not schema.version_of(self.connection)
            except BaseException:
                self.connection.close()
                raise

    def __repr__(self) -> str:
        return f"PostgresReader({self.name})"

    def snapshot(self) -> AbstractContextManager[None]:
        """Let every query of the block see one state of the database."""
        return self.connection.transaction("ISOLATION LEVEL REPEATABLE READ, READ ONLY")

    def version(self) -> int:
        """Return the number of the last event."""
        ((number,),) = self.connection.execute("SELECT last_number FROM meta").fetchall()
        return int(number)

    def failure(self, error: Exception) -> str | None:
        """Return the words for a failure; None: it is a bug of ours."""
        return failure(error)

    def close(self) -> None:
        self.connection.close()


def opened(address: Address) -> PostgresReader:
    """Return a reader of a database that has a store; raise StoreError."""
    reader = PostgresReader(address)
    if reader.is_empty:
        reader.close()
        raise StoreError(f"store {reader.name}: there is no store in it yet")
    return reader
