"""Gateways of a fleet on PostgreSQL: evenness of setpoints, and the datagrams between them."""

import math
import struct
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from itertools import cycle
from pathlib import Path
from select import select
from time import perf_counter

from mav_tasks.basics.clock import boot_time
from mav_tasks.fleet.exchange import Arrived
from mav_tasks.fleet.io.carrier import Carrier
from mav_tasks.store.postgres import schema
from mav_tasks.store.postgres.address import parse
from mav_tasks.store.postgres.session import Session

from .driving import drive
from .processes import cpu_seconds, database, server, simulated_rovers
from .rows import Row, percentiles

#: number of gateways, and rovers of each; 0 gateways: a server without a fleet
SETS = ((0, 20), (1, 20), (0, 100), (1, 100), (4, 25))
DRIVING = 10.0  # s
SECONDS = 5.0  # of datagrams
RATE = 500  # packets/s from each gateway to each other one
FLOOD = 15_000  # packets/s; more than it carries
STAMP = struct.Struct(">d?")
STOP_EVERY = 0.05  # s
AFTER = 0.3  # s in which the last ones arrive


def gateways(tree: Path) -> Iterator[Row]:
    """Setpoints of 20 to 100 rovers of gateways; beside a server without a fleet."""
    alone: dict[int, float] = {}
    for number, each in SETS:
        worst, longest, cpu, of_database = _driven(tree, number, each)
        note = f"longest {longest * 1e3:.0f} ms, {cpu:.2f} cores each, database {of_database:.2f}"
        if not number:
            alone[each] = worst
        what = f"{number} gateways" if number else "a server without a fleet"
        what += f", {each} rovers each: setpoint error, worst p99 of a rover"
        beside = alone[max(1, number) * each] if number else None
        yield Row(what, worst, "ms", beside, "without a fleet", "≤ 5 ms" if number else "", note)


def _driven(tree: Path, number: int, each: int) -> tuple[float, float, float, float]:
    """Return the worst p99 of a rover, the longest interval, and cores of gateway and database."""
    with ExitStack() as stack:
        base = stack.enter_context(database()) if number else None
        store = f"--store={base.new_database() if base else ':memory:'}"
        servers = []
        for index in range(max(1, number)):
            first = 1 + index * each
            rovers = stack.enter_context(simulated_rovers(each, first=first))
            options = ["--arming=server", store, *([f"--gateway=g{index}"] if number else [])]
            it = stack.enter_context(server(tree, rovers, *options, is_timed=True))
            servers.append((first, it))
        for first, it in servers:
            drive(it, each, first=first)
        pids = base.pids() if base else []
        before = sum(it.seconds() for _, it in servers), cpu_seconds(*pids)
        begin = time.monotonic()
        time.sleep(DRIVING)
        end = time.monotonic()
        after = sum(it.seconds() for _, it in servers), cpu_seconds(*pids)
    errors: dict[float, list[float]] = {}
    for _, it in servers:
        for rover, at, error in it.results():
            if begin <= at < end:
                errors.setdefault(rover, []).append(error)
    cores, of_database = ((b - a) / DRIVING for a, b in zip(before, after, strict=True))
    worst = max((percentiles(found).p99 for found in errors.values()), default=math.inf)
    longest = 0.05 + max(map(max, errors.values()), default=math.inf)
    return worst, longest, cores / len(servers), of_database


def carrier(_tree: Path) -> Iterator[Row]:
    """STOPs and packets between gateways; beside a round trip of one gateway to its database."""
    with database() as base:
        session = Session(parse(base.new_database()), purpose="bench")
        trips = []
        for _ in range(1_000):
            begin = perf_counter()
            session.execute("SELECT 1")
            trips.append(perf_counter() - begin)
        session.close()
        trip = percentiles(trips).p50
        for number, rate in ((2, 0), (2, RATE), (4, RATE), (2, FLOOD)):
            url = base.new_database()
            session = Session(parse(url), purpose="bench")
            schema.migrate(session)
            session.close()
            names = {f"g{n}" for n in range(number)}
            mails = [(url, name, sorted(names - {name}), rate) for name in names]
            with ProcessPoolExecutor(number) as pool:
                results = pool.map(mail, *zip(*mails, strict=True))
            stops, ordinary, sent_by, cpu_of = zip(*results, strict=True)
            found = percentiles([one for each in stops for one in each])
            arrived, sent, cpu = sum(map(len, ordinary)), sum(sent_by), sum(cpu_of) / number
            what = f"{number} gateways, {rate:,} packets/s to each other"
            note = f"p50 {found.p50 * 1e3:.2f} ms; {arrived / SECONDS:,.0f} of"
            note += f" {sent / SECONDS:,.0f} packets/s arrived; processor {cpu / SECONDS:.0%} each"
            yield Row(f"{what}: STOP, p99", found.p99, "ms", trip, "round trip", "≤ 100 ms", note)
            if rate:
                late = percentiles([one for each in ordinary for one in each])
                yield Row(f"{what}: packet, p50", late.p50, "ms", trip, "round trip")


def mail(
    url: str, name: str, others: list[str], rate: float
) -> tuple[list[float], list[float], int, float]:
    """Be one gateway: send datagrams, with their time, to all others, once these are there.

    Return the latencies of STOPs and of other datagrams, how many it sent, and processor time.
    """
    carrier = Carrier(parse(url), name)
    stops: list[float] = []
    ordinary: list[float] = []

    def receive(within: float) -> None:
        fd = carrier.fileno()
        assert fd is not None, "it is open"
        select([fd], [], [], max(0.0, within))
        now = boot_time()
        for each in carrier.take():
            if not isinstance(each, Arrived):
                raise SystemExit(f"the database: {each.words}")
            sent_at, is_stop = STAMP.unpack_from(each.payload)
            (stops if is_stop else ordinary).append(now - sent_at)

    def payload(*, is_stop: bool) -> bytes:
        return STAMP.pack(boot_time(), is_stop).ljust(60, b"\0")  # as an average MAVLink packet

    step = 1 / (rate * len(others)) if rate else SECONDS
    while not carrier.peers >= set(others):
        receive(0.01)
    receive(1.0)  # the others meet each other
    used, sent, whom = cpu_seconds("self"), 0, cycle(others)
    next_one = next_stop = boot_time()
    end = next_stop + SECONDS
    while (now := boot_time()) < end:
        while rate and next_one <= now:
            carrier.send(next(whom), payload(is_stop=False))
            sent += 1
            next_one += step
        if next_stop <= now:
            carrier.send("", payload(is_stop=True), first=True)
            next_stop += STOP_EVERY
        receive(min(next_stop, next_one if rate else end, end) - boot_time())
    while boot_time() < end + AFTER:
        receive(AFTER)
    carrier.close()
    return stops, ordinary, sent, cpu_seconds("self") - used
