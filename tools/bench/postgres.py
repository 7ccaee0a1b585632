"""COMMAND_LONG → COMMAND_ACK with the store in PostgreSQL, compared with one INSERT by psycopg.

A database server of its own (``tests/kit/postgres.py``), on this machine's disk and as durable as a
user's. Commands and INSERTs take turns, because a sync takes longer while a disk has other work.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from statistics import quantiles
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

from mav_tasks.mavlink import messages as m
from rover_sim.postgres import installed
from tests.kit.postgres import PostgresServer, connected

from .commands import OUTSTANDING, latency, many, one_by_one, packets, server
from .table import Row

ROUNDS = 40
EACH = 50  # commands, and INSERTs, in a round
WARM_UP = 500
MANY = 40_000
BODY = "x" * 300  # about the row of a submission
GOAL_RATIO = 1.3
GOAL_RATE = 5_000


def measure() -> list[Row]:
    """Return the rows of latency and of rate."""
    supply = iter(packets())
    answer = m.CommandAck.id
    ours: list[float] = []
    inserts: list[float] = []
    with database_server() as database, connected(database.new_database()) as plain:
        plain.execute("CREATE TABLE public.plain (id BIGSERIAL, body TEXT)")
        with server("--store", database.new_database()) as (client, vehicle):
            one_by_one(client, list(islice(supply, WARM_UP)), answer, vehicle)
            for _ in range(ROUNDS):
                inserts += [_insert(plain) for _ in range(EACH)]
                ours += one_by_one(client, list(islice(supply, EACH)), answer, vehicle)
            rate = many(client, list(islice(supply, MANY)), answer, vehicle)
    our, their = quantiles(ours, n=100), quantiles(inserts, n=100)
    return [
        latency("on PostgreSQL → ack, p50", our[49], their[49], goal=GOAL_RATIO, of="INSERT"),
        latency("on PostgreSQL → ack, p99", our[98], their[98], goal=None, of="INSERT"),
        Row(
            f"acks on PostgreSQL, {OUTSTANDING} outstanding",
            f"{rate:,.0f} /s",
            f"{1 / their[49]:,.0f} /s INSERTs, one by one",
            f"{rate * their[49]:.1f}×",
            f"≥ {GOAL_RATE:,} /s",
            rate >= GOAL_RATE,
        ),
    ]


def _insert(plain: Any) -> float:
    """Return the seconds of one INSERT, until it is durable."""
    start = perf_counter()
    plain.execute("INSERT INTO public.plain (body) VALUES (%s)", (BODY,))
    return perf_counter() - start


@contextmanager
def database_server() -> Iterator[PostgresServer]:
    """Run a database server; records of halts are in a folder that is removed."""
    before = os.environ.get("XDG_DATA_HOME")
    made = PostgresServer(installed())
    try:
        made.start()
        with TemporaryDirectory() as folder:
            os.environ["XDG_DATA_HOME"] = folder
            yield made
    finally:
        made.close()
        if before is None:
            os.environ.pop("XDG_DATA_HOME", None)
        else:
            os.environ["XDG_DATA_HOME"] = before
