"""Carriers of several gateways that have met, by way of a real PostgreSQL."""

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager

from mav_tasks.fleet_io.carrier import Carrier
from mav_tasks.fleet_io.lease_database import LeaseDatabase
from mav_tasks.store.postgres.address import parse
from tests.kit.processes import wait_until

LIMIT = 20.0  # s


@contextmanager
def carriers(url: str, *names: str) -> Iterator[list[Carrier]]:
    """Run carriers that have met."""
    LeaseDatabase(parse(url), "first", host="127.0.0.1", port=1).close()  # makes the tables
    with ExitStack() as ends:
        found = [ends.enter_context(closing(Carrier(parse(url), name))) for name in names]
        for name, it in zip(names, found, strict=True):
            others = frozenset(names) - {name}
            wait_until(lambda it=it, others=others: it.peers == others, within=LIMIT)  # type: ignore[misc]
        yield found
