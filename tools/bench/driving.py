"""Evenness of 20 Hz setpoints and time to a STOP: alone, flooded with datagrams, in a fleet.

A client's flood comes on its own link, which is the worst case, and reads no answers.
"""

import json
import struct
from collections import defaultdict, deque
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from hashlib import shake_128
from itertools import count, cycle, repeat
from math import inf
from select import select
from time import monotonic, process_time, sleep
from typing import NamedTuple

from mav_tasks.basics.clock import boot_time
from mav_tasks.fleet.exchange import Arrived
from mav_tasks.fleet.io.carrier import Carrier
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.signing import signed
from mav_tasks.store.postgres import schema
from mav_tasks.store.postgres.address import parse
from mav_tasks.store.postgres.session import Session
from tests.kit.postgres import PostgresServer
from tests.kit.processes import wait_until

from .harness import (
    CHILD,
    CLIENT,
    STATION,
    STOP,
    Peer,
    Process,
    Rovers,
    Row,
    Rows,
    beside,
    cpu_seconds,
    database,
    effect,
    flood,
    introduced,
    move,
    p50,
    p99,
    paced,
    server,
    simulated_rovers,
    stops,
    timed,
)

ROVERS = (1, 20, 100, 150, 240)  # MAVLink has system ids for no more
FLEETS = ((1, 20), (1, 100), (4, 25))  # gateways, and rovers of each
SECONDS = 10.0  # of driving
PERIOD = 0.05  # s between two setpoints
SUBMITTED = 300  # tasks/s, to one rover after another
FLOODED = 5  # rovers
RATE = 20_000  # datagrams/s demanded; a slow machine sends fewer
TELEMETRY = 5_000  # packets/s
FEW, MANY = 150, 300  # STOPs
AT_A_TIME = 64  # sockets of strangers at once
SECRET = b"nobody knows this key at all ..."
CARRIED = 5.0  # s of datagrams between gateways
#: gateways, and packets/s from each to each other one; the last are more than it carries
CARRIERS = ((2, 0), (2, 500), (4, 500), (2, 15_000))
STAMP = struct.Struct(">d?")
STOPS = 20  # a second
AFTER = 0.3  # s in which the last ones arrive

client = Encoder(CLIENT).encode


class Driven(NamedTuple):
    """Deviations of intervals from PERIOD, p99 of all and of the worst rover; memory grown."""

    error: float
    worst: float
    grown: int
    note: str


def setpoints() -> Rows:
    """Deviation of the interval between 20 Hz setpoints from 50 ms, for 1 to 240 rovers."""
    for rovers in ROVERS:
        it = driven(rovers)
        what = f"setpoint error, p99, {rovers} rovers"
        yield Row(what, it.error, "ms", goal="≤ 5 ms", note=it.note)


def gateways() -> Rows:
    """The same for gateways, p99 of the worst rover; beside a server without a fleet."""
    for number, rovers in FLEETS:
        alone = driven(number * rovers).worst
        it = driven(rovers, number)
        what = f"setpoint error, worst p99 of a rover, {number} gateways, {rovers} rovers each"
        yield Row(what, it.worst, "ms", alone, "without a fleet", "≤ 5 ms", it.note)


def driven(
    rovers: int,
    gateways: int = 0,
    *,
    is_limited: bool = False,
    meanwhile: Callable[[int], AbstractContextManager[object]] = nullcontext,
) -> Driven:
    """Drive rovers by a server, or by each of some gateways; with ``meanwhile`` at its port."""
    with ExitStack() as stack:
        base = stack.enter_context(database()) if gateways else None
        options = ["--arming=server", f"--store={base.new_database() if base else ':memory:'}"]
        servers: list[Process] = []
        for index in range(gateways or 1):
            port = stack.enter_context(simulated_rovers(rovers, first=1 + index * rovers))
            named = [*options, *([f"--gateway=g{index}"] if gateways else [])]
            running = server(port, *named, cli=("-P", CHILD), is_limited=is_limited)
            servers.append(stack.enter_context(running))
        for index, it in enumerate(servers):
            _drive(it, 1 + index * rovers, rovers)
        with meanwhile(servers[0].port):
            memory, used, began = servers[0].memory(), _used(servers, base), monotonic()
            sleep(SECONDS)
            grown = servers[0].memory() - memory
            cores = [(b - a) / SECONDS for a, b in zip(used, _used(servers, base), strict=True)]
        for it in servers:
            it.end()
        sent = [each for it in servers for each in json.loads(it.text.splitlines()[-1])]
    errors = defaultdict[int, list[float]](list)
    for rover, at, interval in sent:
        if began <= at < began + SECONDS:
            errors[rover].append(abs(interval - PERIOD))
    everything = [error for each in errors.values() for error in each]
    note = f"p50 {p50(everything) * 1e3:.2f} ms, {len(errors)} rovers,"
    note += f" {cores[0] / len(servers):.2f} cores each, database {cores[1]:.2f}"
    return Driven(p99(everything), max(map(p99, errors.values())), grown, note)


def _used(servers: list[Process], base: PostgresServer | None) -> tuple[float, float]:
    return sum(it.seconds() for it in servers), cpu_seconds(*(base.pids() if base else ()))


def _drive(it: Process, first: int, rovers: int) -> None:
    """Submit a long move to each rover, once all have sent a position."""
    wait_until(lambda: it.text.count(": found") >= rovers, within=20.0, what=f"{rovers} rovers")
    sleep(3.0)
    with Peer(to=it.port) as driver:
        driver.beat()
        moves = (driver.encode(move(at, 100.0, rover=at)) for at in range(first, first + rovers))
        flood(SUBMITTED, moves, repeat(driver))
    sleep(2.0)  # they arm


def commands() -> Iterator[bytes]:
    """Yield submissions."""
    return (client(move(number % 0xFFFFFF + 1)) for number in count())


def broken() -> Iterator[bytes]:
    """Yield noise and packets with a wrong bit by turns, the same in every run."""
    for number, made in enumerate(commands()):
        yield shake_128(made).digest(1 + number % 299)
        raw = bytearray(made)
        raw[number % len(raw)] ^= 1 << number % 8
        yield bytes(raw)


def uploads() -> Iterator[bytes]:
    """Yield beginnings of uploads that are never continued, each of another system id."""
    encoders = cycle([Encoder(Address(number, 190)).encode for number in range(1, 255)])
    for number, encode in enumerate(encoders):
        yield encode(m.MissionCount(1, (1, 191)[number % 2], 1000, number % 3))


def requests() -> Iterator[bytes]:
    """Yield requests of every message, at the highest rate and once by turns."""
    for number in count():
        often, once = MavCmd.SET_MESSAGE_INTERVAL, MavCmd.REQUEST_MESSAGE
        for wanted in ((often, 0, number % 400, 1.0), (once, 0, number % 400, 0.0)):
            yield client(m.CommandLong(1, 1, *wanted, 0, 0, 0, 0, 0))


def signatures() -> Iterator[bytes]:
    """Yield submissions that are signed with a key of nobody."""
    return (signed(made, SECRET, link_id=1, timestamp=at) for at, made in enumerate(commands()))


def strangers() -> Iterator[bytes]:
    """Yield heartbeats, each of which comes from a socket of its own."""
    return repeat(client(STATION))


FLOODS = {each.__name__: each for each in (commands, broken, uploads, requests, signatures)}
FLOODS |= {"strangers": strangers}


def from_clients(kind: str, rate: float, port: int) -> None:
    """Flood a server: each datagram of strangers has a new socket."""

    def new() -> Iterator[Peer]:
        present = deque[Peer](maxlen=AT_A_TIME)
        while True:
            present.append(Peer(to=port))
            yield present[-1]

    flood(rate, FLOODS[kind](), new() if kind == "strangers" else repeat(Peer(to=port)))


def from_rover(rover: Rovers) -> None:
    """Flood a server with telemetry."""
    made = (rover.encode(m.Attitude(at & 0xFFFFFF, 0, 0, 0.1, 0, 0, 0)) for at in count())
    flood(TELEMETRY, made, repeat(rover))


def stop() -> Rows:
    """STOP → zero setpoint, while the rover floods the server with telemetry; beside without."""
    found = []
    for load in (None, from_rover):
        with introduced() as (_, client, rover), beside(load, rover):
            found.append(_stopped(client, rover, MANY))
    calm, flooded = found
    what = f"STOP → zero setpoint, {TELEMETRY:,} packets/s"
    yield Row(f"{what}, p99", p99(flooded), "ms", p99(calm), "without", "≤ 5 ms")
    yield Row(f"{what}, p50", p50(flooded), "ms", p50(calm), "without")


def _stopped(client: Peer, rover: Rovers, count: int) -> list[float]:
    """Return the seconds of STOPs until their zero setpoint is at the rover's socket, if it is."""

    def ask() -> float:
        for peer in (client, rover):
            peer.beat()
            peer.drain()
        packet = client.encode(STOP)
        return effect(client, packet, m.SetPositionTargetLocalNed.id, at=rover, within=0.25)

    return [each for each in stops(ask, count=count) if each < inf]


def floods() -> Rows:
    """STOP → zero setpoint, setpoints, and memory, beside each of six floods; and without."""
    found = {kind: _flooded(kind) for kind in ("", *FLOODS)}
    calm, without = found.pop("")
    for kind, (times, it) in found.items():
        what, note = f"flood of {kind}", f"{FEW - len(times)} of {FEW} lost"
        stop = f"{what}: STOP → zero, p99"
        yield Row(stop, p99(times), "ms", p99(calm), "without", "≤ 5 ms", note)
        yield Row(
            f"{what}: setpoint error, p99", it.error, "ms", without.error, "without", "≤ 5 ms"
        )
        yield Row(f"{what}: memory grown", it.grown, "kB", without.grown, "without")


def _flooded(kind: str) -> tuple[list[float], Driven]:
    @contextmanager
    def flooding(port: int) -> Iterator[None]:
        with beside(from_clients if kind else None, kind, RATE, port):
            sleep(0.5)
            yield

    with introduced(is_limited=True) as (it, client, rover), flooding(it.port):
        times = _stopped(client, rover, FEW)
    return times, driven(FLOODED, is_limited=True, meanwhile=flooding)


def carrier() -> Rows:
    """STOPs and packets between gateways; beside a round trip of one gateway to its database."""
    with database() as base:
        for number, rate in CARRIERS:
            url = base.new_database()
            session = Session(parse(url), purpose="bench")
            schema.migrate(session)
            trip = p50([timed(lambda: session.execute("SELECT 1")) for _ in range(500)])  # noqa: B023
            session.close()
            names = [f"g{n}" for n in range(number)]
            with ProcessPoolExecutor(number) as pool:
                each = pool.map(_gateway, [url] * number, names, [names] * number, [rate] * number)
            stops, late, arrived, cpu = zip(*each, strict=True)
            note = f"{sum(arrived) / CARRIED:,.0f} packets/s arrived, median after"
            note += f" {p50(late) * 1e3:.1f} ms; processor {sum(cpu) / CARRIED / number:.0%} each"
            what = f"{number} gateways, {rate:,} packets/s to each other: STOP, p99"
            yield Row(what, max(stops), "ms", trip, "round trip", "≤ 100 ms", note)


def _gateway(url: str, name: str, names: list[str], rate: int) -> tuple[float, float, int, float]:
    """Send datagrams, with their time, to all other gateways, once these are there.

    Return p99 of STOPs' latency, the median of other datagrams', how many came, processor time.
    """
    carrier, others = Carrier(parse(url), name), [each for each in names if each != name]
    found: tuple[list[float], list[float]] = [], []

    def receive(seconds: float) -> None:
        now, end = boot_time(), boot_time() + seconds
        while True:
            select([carrier.fileno() or 0], [], [], max(0.0, end - now))
            now = boot_time()
            for each in carrier.take():
                assert isinstance(each, Arrived), each
                sent_at, is_stop = STAMP.unpack_from(each.payload)
                found[not is_stop].append(now - sent_at)
            if now >= end:
                return

    def send(to: str, *, is_stop: bool) -> None:
        """Send as much as an average MAVLink packet."""
        payload = STAMP.pack(boot_time(), is_stop).ljust(60, b"\0")
        carrier.send(to, payload, first=is_stop)

    while not carrier.peers >= set(others):
        receive(0.01)
    receive(1.0)  # the others meet each other
    used, whom = process_time(), cycle(others)
    each_s = rate * len(others) or STOPS  # datagrams
    for number in paced(each_s, range(round(CARRIED * each_s)), receive):
        if rate:
            send(next(whom), is_stop=False)
        if number % (each_s // STOPS) == 0:
            send("", is_stop=True)
    receive(AFTER)
    carrier.close()
    return p99(found[0]), p50(found[1] or [0.0]), len(found[1]), process_time() - used
