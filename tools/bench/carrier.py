"""Datagrams between gateways over PostgreSQL: latency, rate, and what they cost.

Two and four gateways, each a process, on a database server of its own. Each sends STOPs to all
others, and MAVLink packets to each. The yardstick is a round trip of one gateway to the database.
"""

import json
import subprocess
import sys
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import chain
from statistics import quantiles
from time import perf_counter

from mav_tasks.store.postgres import schema
from mav_tasks.store.postgres.address import parse
from mav_tasks.store.postgres.session import Session
from tests.kit.postgres import PostgresServer

from .carrier_result import Result, cpu_seconds
from .postgres import database_server
from .table import Row

SECONDS = 8.0
RATE = 500  # packets/s from each gateway to each other one
FLOOD = 15_000  # packets/s; more than it carries
GOAL = 0.1  # s, for a STOP
ROUND_TRIPS = 2_000


@dataclass
class _Run:
    results: list[Result]
    database_cpu: float  # s


def measure() -> list[Row]:
    """Return the rows."""
    rows: list[Row] = []
    with database_server() as server:
        trip = _round_trip(server)
        for what, gateways, rate, commit in (
            ("2 gateways, STOPs only", 2, 0, "off"),
            ("2 gateways, STOPs only, synchronous_commit", 2, 0, "on"),
            (f"2 gateways, {RATE}/s each way", 2, RATE, "off"),
            (f"2 gateways, {RATE}/s each way, synchronous_commit", 2, RATE, "on"),
            (f"4 gateways, {RATE}/s in all from each", 4, RATE / 3, "off"),
            (f"4 gateways, {RATE}/s each way", 4, RATE, "off"),
        ):
            rows += _rows(what, _run(server, gateways, rate, commit), trip)
        flood = _run(server, 2, FLOOD, "off")
        arrived = sum(len(each.ordinary) for each in flood.results) / SECONDS
        of = f"{2 * FLOOD:,} /s offered"
        rows.append(Row("2 gateways, flood", f"{arrived:,.0f} /s", of, "", "", None))
        rows += _rows("2 gateways, flood", flood, trip)[:1]
    return rows


def _rows(what: str, run: _Run, trip: float) -> list[Row]:
    rows = []
    for kind, of, goal in (
        ("STOP", [each.stops for each in run.results], GOAL),
        ("packet", [each.ordinary for each in run.results], None),
        ("waited is over by", [each.over for each in run.results], None),
    ):
        values = list(chain.from_iterable(of))
        if len(values) < 100:
            continue
        p50, p99 = (quantiles(values, n=100)[at] for at in (49, 98))
        rows.append(
            Row(
                f"{what}: {kind}, p50 / p99",
                f"{p50 * 1000:.2f} / {p99 * 1000:.2f} ms",
                f"{trip * 1000:.2f} ms round trip",
                f"{p50 / trip:.1f}×",
                f"p99 ≤ {goal * 1000:.0f} ms" if goal else "",
                p99 <= goal if goal else None,
            )
        )
    sent = sum(each.sent for each in run.results)
    arrived = sum(len(each.ordinary) for each in run.results)
    gateway = sum(each.cpu for each in run.results) / len(run.results) / SECONDS
    rows.append(
        Row(
            f"{what}: processor of a gateway / of PostgreSQL",
            f"{gateway:.1%} / {run.database_cpu / SECONDS:.1%}",
            f"{arrived:,} of {sent:,} arrived",
            "",
            "",
            None,
        )
    )
    return rows


def _run(server: PostgresServer, count: int, rate: float, commit: str) -> _Run:
    """Let gateways exchange datagrams."""
    url = server.new_database()
    _make_tables(url)
    names = [f"g{n}" for n in range(count)]
    with ExitStack() as stack:
        children = []
        for name in names:
            others = ",".join(each for each in names if each != name)
            what = (url, name, others, str(rate), str(SECONDS), commit)
            children.append(
                stack.enter_context(
                    subprocess.Popen(
                        [sys.executable, "-m", "tools.bench.carrier_child", *what],
                        stdin=subprocess.PIPE,
                        stdout=subprocess.PIPE,
                        text=True,
                    )
                )
            )
        for each in children:
            _line(each)
        pids = server.pids()
        before = sum(map(cpu_seconds, pids))
        for each in children:
            assert each.stdin is not None
            each.stdin.write("go\n")
            each.stdin.flush()
        results = [Result(**json.loads(_line(each))) for each in children]
        return _Run(results, sum(map(cpu_seconds, pids)) - before)


def _line(child: "subprocess.Popen[str]") -> str:
    assert child.stdout is not None
    line = child.stdout.readline()
    if not line:
        raise RuntimeError("a gateway has ended")
    return line


def _make_tables(url: str) -> None:
    session = Session(parse(url), purpose="bench")
    schema.migrate(session)
    session.close()


def _round_trip(server: PostgresServer) -> float:
    """Return the median seconds of a statement that does nothing."""
    session = Session(parse(server.new_database()), purpose="bench")
    times = []
    for _ in range(ROUND_TRIPS):
        start = perf_counter()
        session.execute("SELECT 1")
        times.append(perf_counter() - start)
    session.close()
    return quantiles(times, n=100)[49]
