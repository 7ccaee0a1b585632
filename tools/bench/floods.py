"""STOPs, setpoints and memory of a server that is flooded with datagrams.

A client's flood comes on its own link, which is the worst case, and reads no answers.
"""

import random
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from itertools import count, repeat
from pathlib import Path

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.signing import signed

from .driving import driven
from .processes import beside
from .rows import Row, percentiles
from .wire import CLIENT, STATION, STOP, Rovers, Speaker, effect, introduced, move, stops

ROVERS = 5
RATE = 20_000  # datagrams/s demanded; a slow machine sends fewer
TELEMETRY = 5_000  # packets/s
FEW, MANY = 150, 300  # STOPs
AT_A_TIME = 64  # sockets of strangers at once
ZERO = m.SetPositionTargetLocalNed.id
SECRET = b"nobody knows this key at all ..."

client = Encoder(CLIENT).encode


def commands() -> Iterator[bytes]:
    """Yield submissions."""
    return (client(move(number % 0xFFFFFF + 1)) for number in count())


def broken() -> Iterator[bytes]:
    """Yield noise and packets with a wrong bit by turns, the same in every run."""
    source = random.Random(1)
    for made in commands():
        yield source.randbytes(source.randrange(1, 300))
        raw = bytearray(made)
        raw[source.randrange(len(raw))] ^= 1 << source.randrange(8)
        yield bytes(raw)


def uploads() -> Iterator[bytes]:
    """Yield beginnings of uploads that are never continued, each of another system id."""
    encoders = [Encoder(Address(number, 190)).encode for number in range(1, 255)]
    for number in count():
        yield encoders[number % 254](m.MissionCount(1, (1, 191)[number % 2], 1000, number % 3))


def requests() -> Iterator[bytes]:
    """Yield requests of every message, at the highest rate and once by turns."""
    for number in count():
        often, once = MavCmd.SET_MESSAGE_INTERVAL, MavCmd.REQUEST_MESSAGE
        for wanted in ((often, 0, number % 400, 1.0), (once, 0, number % 400, 0.0)):
            yield client(m.CommandLong(1, 1, *wanted, 0, 0, 0, 0, 0))


FLOODS: dict[str, Callable[[], Iterator[bytes]]] = {
    "commands": commands,
    "broken": broken,
    "uploads": uploads,
    "requests": requests,
    "signatures": lambda: (
        signed(made, SECRET, link_id=1, timestamp=at) for at, made in enumerate(commands())
    ),
    "strangers": lambda: repeat(client(STATION)),
}


def flood(rate: float, packets: Iterable[bytes], speakers: Iterable[Speaker]) -> None:
    """Send datagrams at a rate, each from the next of these."""
    begin = time.monotonic()
    for sent, (packet, speaker) in enumerate(zip(packets, speakers, strict=False)):
        speaker.socket.send(packet)
        if sent % 10 == 0:
            time.sleep(max(0.0, begin + sent / rate - time.monotonic()))


def from_clients(kind: str, rate: float, port: int) -> None:
    """Flood a server: each datagram of strangers has a new socket."""
    flood(
        rate, FLOODS[kind](), strangers(port) if kind == "strangers" else repeat(Speaker(to=port))
    )


def strangers(port: int) -> Iterator[Speaker]:
    """Yield new clients without end."""
    present: deque[Speaker] = deque(maxlen=AT_A_TIME)
    while True:
        present.append(Speaker(to=port))
        yield present[-1]


def from_rover(rover: Rovers) -> None:
    """Flood a server with telemetry."""
    made = (rover.encode(m.Attitude(at & 0xFFFFFF, 0, 0, 0.1, 0, 0, 0)) for at in count())
    flood(TELEMETRY, made, repeat(rover))


def stop(tree: Path) -> Iterator[Row]:
    """STOP → zero setpoint, while the rover floods the server with telemetry; beside without."""
    found = []
    for is_flooded in (False, True):
        with (
            introduced(tree) as (_, client, rover),
            beside(from_rover, rover) if is_flooded else nullcontext(),
        ):
            times, _ = stops(lambda: stopped(client, rover), count=MANY)
        found.append(percentiles(times))
    calm, flooded = found
    what = f"STOP → zero setpoint, {TELEMETRY:,} packets/s"
    yield Row(f"{what}, p99", flooded.p99, "ms", calm.p99, "without", "≤ 5 ms")
    yield Row(f"{what}, p50", flooded.p50, "ms", calm.p50, "without")


def stopped(client: Speaker, rover: Rovers) -> float:
    """Return the seconds of a STOP until its zero setpoint is at the rover's socket."""
    rover.live()
    client.beat()
    rover.drain()
    client.drain()
    return effect(client, client.encode(STOP), ZERO, at=rover, within=0.25)


def measure(tree: Path) -> Iterator[Row]:
    """STOP → zero setpoint, setpoints, and memory, beside each of six floods; and without."""
    found = {kind: _flooded(tree, kind) for kind in ("", *FLOODS)}
    stop, _, error, memory = found.pop("")
    for kind, (took, lost, late, grown) in found.items():
        what, note = f"flood of {kind}", f"{lost} of {FEW} lost"
        yield Row(f"{what}: STOP → zero, p99", took, "ms", stop, "without", "≤ 5 ms", note)
        yield Row(f"{what}: setpoint error, p99", late, "ms", error, "without", "≤ 5 ms")
        yield Row(f"{what}: memory grown", grown, "kB", memory, "without")


def _flooded(tree: Path, kind: str) -> tuple[float, int, float, float]:
    """Return p99 of STOPs, how many were lost, p99 of setpoints' errors, and memory grown."""

    @contextmanager
    def flooding(port: int) -> Iterator[None]:
        with beside(from_clients, kind, RATE, port) if kind else nullcontext():
            time.sleep(0.5)
            yield

    with introduced(tree, is_limited=True) as (it, client, rover), flooding(it.port):
        times, lost = stops(lambda: stopped(client, rover), count=FEW)
    drive = driven(tree, ROVERS, is_limited=True, meanwhile=flooding)
    return percentiles(times).p99, lost, drive.errors.p99, drive.grown
