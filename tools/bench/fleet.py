"""The datagrams that gateways of a fleet send each other through PostgreSQL."""

import struct
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import cycle
from pathlib import Path
from select import select
from statistics import median
from time import process_time

from mav_tasks.basics.clock import boot_time
from mav_tasks.fleet.exchange import Arrived
from mav_tasks.fleet.io.carrier import Carrier
from mav_tasks.store.postgres import schema
from mav_tasks.store.postgres.address import parse
from mav_tasks.store.postgres.session import Session

from .processes import database
from .rows import Row, percentiles
from .speed import timed

SECONDS = 5.0  # of datagrams
RATE = 500  # packets/s from each gateway to each other one
FLOOD = 15_000  # packets/s; more than it carries
STAMP = struct.Struct(">d?")
STOP_EVERY = 0.05  # s
AFTER = 0.3  # s in which the last ones arrive


def measure(_tree: Path) -> Iterator[Row]:
    """STOPs and packets between gateways; beside a round trip of one gateway to its database."""
    with database() as base:
        for number, rate in ((2, 0), (2, RATE), (4, RATE), (2, FLOOD)):
            url = base.new_database()
            session = Session(parse(url), purpose="bench")
            schema.migrate(session)
            trip = median([timed(lambda: session.execute("SELECT 1")) for _ in range(500)])  # noqa: B023
            session.close()
            names = [f"g{n}" for n in range(number)]
            with ProcessPoolExecutor(number) as pool:
                each = pool.map(mail, [url] * number, names, [names] * number, [rate] * number)
            stops, late, arrived, cpu = zip(*each, strict=True)
            what = f"{number} gateways, {rate:,} packets/s to each other"
            note = f"{sum(arrived) / SECONDS:,.0f} packets/s arrived, median after"
            note += (
                f" {median(late) * 1e3:.1f} ms; processor {sum(cpu) / SECONDS / number:.0%} each"
            )
            p99 = max(stops)
            yield Row(f"{what}: STOP, p99", p99, "ms", trip, "round trip", "≤ 100 ms", note)


def mail(url: str, name: str, names: list[str], rate: float) -> tuple[float, float, int, float]:
    """Be one gateway: send datagrams, with their time, to all others, once these are there.

    Return p99 of STOPs' latency, the median of other datagrams', how many came, processor time.
    """
    carrier, others = Carrier(parse(url), name), [each for each in names if each != name]
    found: tuple[list[float], list[float]] = [], []

    def receive(within: float) -> None:
        select([carrier.fileno() or 0], [], [], max(0.0, within))
        now = boot_time()
        for each in carrier.take():
            assert isinstance(each, Arrived), each
            sent_at, is_stop = STAMP.unpack_from(each.payload)
            found[not is_stop].append(now - sent_at)

    def send(to: str, *, is_stop: bool) -> float:
        """Send as much as an average MAVLink packet; return when the next one is due."""
        payload = STAMP.pack(boot_time(), is_stop).ljust(60, b"\0")
        carrier.send(to, payload, first=is_stop)
        return STOP_EVERY if is_stop else 1 / (rate * len(others))

    while not carrier.peers >= set(others):
        receive(0.01)
    receive(1.0)  # the others meet each other
    used, whom, now = process_time(), cycle(others), boot_time()
    next_stop, end = now, now + SECONDS
    next_one = now if rate else end
    while (now := boot_time()) < end:
        while next_one <= now:
            next_one += send(next(whom), is_stop=False)
        if next_stop <= now:
            next_stop += send("", is_stop=True)
        receive(min(next_stop, next_one, end) - boot_time())
    while boot_time() < end + AFTER:
        receive(AFTER)
    carrier.close()
    spent = process_time() - used
    return percentiles(found[0]).p99, median(found[1] or [0.0]), len(found[1]), spent
