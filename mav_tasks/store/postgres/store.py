"""The kind of store whose place is a URL of PostgreSQL."""

from collections.abc import Callable
from contextlib import ExitStack, closing

from mav_tasks.config.settings import Retention
from mav_tasks.store import reading
from mav_tasks.store.base import Which
from mav_tasks.store.durable import DurableStore
from mav_tasks.store.halt_record import HaltRecord
from mav_tasks.store.journal import Journal
from mav_tasks.store.postgres import address
from mav_tasks.store.postgres.address import Address
from mav_tasks.store.postgres.database import PostgresDatabase
from mav_tasks.store.postgres.local_path import local_path
from mav_tasks.store.postgres.reader import PostgresReader, opened


class PostgresStore(DurableStore):
    """A store in a PostgreSQL database; its halt record is a file on this machine.

    The constructor raises StoreError, with a text of one line, if the database cannot be used.
    """

    def __init__(
        self,
        where: Address,
        *,
        wall_offset: Callable[[], float],
        retention: Retention | None = None,
    ) -> None:
        name = where.shown
        with ExitStack() as begun:
            database = PostgresDatabase(where)
            begun.callback(database.close, utc=None)
            path = local_path(database.name, database.fleet, name=name)
            record = HaltRecord(path, name=name)
            begun.callback(record.close)
            record.belong_to(database.fleet)
            database.begin()
            release = begun.pop_all().close
        super().__init__(
            database,
            record,
            name=name,
            wall_offset=wall_offset,
            retention=retention,
            release=release,
        )


def open_store(place: str, wall_offset: Callable[[], float], retention: Retention) -> PostgresStore:
    """Open a database; create the tables if they do not exist."""
    return PostgresStore(address.parse(place), wall_offset=wall_offset, retention=retention)


def open_journal(place: str, which: Which) -> Journal:
    """Open the journal of a database that has a store."""
    return Journal(opened(address.parse(place)), which)


def read_parameters(place: str) -> dict[str, float]:
    """Return the parameters in a database; {} if it has no store yet."""
    with closing(PostgresReader(address.parse(place))) as reader:
        return {} if reader.is_empty else reading.read_parameters(reader)
