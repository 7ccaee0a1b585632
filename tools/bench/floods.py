"""STOPs, setpoints and memory of a server that a client floods with datagrams.

The flood comes on the client's own link, which is the worst case, and reads no answers.
"""

import random
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from itertools import count
from pathlib import Path

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.signing import signed

from .driving import drive
from .processes import beside, server, simulated_rovers
from .rows import Row, percentiles
from .speed import stopped
from .wire import CLIENT, STATION, Speaker, introduced, move, stops

ROVERS = 5
SECONDS = 5.0  # of driving
RATE = 20_000  # datagrams/s demanded; a slow machine sends fewer
STOPS = 150
AT_A_TIME = 64  # sockets of strangers at once
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
    "strangers": lambda: (client(STATION) for _ in count()),
}


def flood(packets: Iterator[bytes], rate: float, sockets: Callable[[], list[Speaker]]) -> None:
    """Send datagrams at a rate, each AT_A_TIME from these sockets."""
    begin = time.monotonic()
    speakers: list[Speaker] = []
    for sent, packet in enumerate(packets):
        if sent % AT_A_TIME == 0:
            speakers = sockets()
        speakers[sent % len(speakers)].socket.send(packet)
        ahead = begin + sent / rate - time.monotonic()
        if sent % 10 == 0 and ahead > 0:
            time.sleep(ahead)


def from_clients(kind: str, port: int, rate: float) -> None:
    """Flood a server: of strangers each AT_A_TIME have new sockets."""
    own = [Speaker(to=port)]
    strangers = kind == "strangers"
    many = range(AT_A_TIME)
    flood(FLOODS[kind](), rate, lambda: [Speaker(to=port) for _ in many] if strangers else own)


def measure(tree: Path) -> Iterator[Row]:
    """STOP → zero setpoint, setpoints, and memory, beside each of six floods; and without."""
    found = {kind: _flooded(tree, kind) for kind in ("", *FLOODS)}
    stop, _, error, memory = found.pop("")
    for kind, (took, lost, late, grown) in found.items():
        what, note = f"flood of {kind}", f"{lost} of {STOPS} lost"
        yield Row(f"{what}: STOP → zero, p99", took, "ms", stop, "without", "≤ 5 ms", note)
        yield Row(f"{what}: setpoint error, p99", late, "ms", error, "without", "≤ 5 ms")
        yield Row(f"{what}: memory grown", grown, "kB", memory, "without")


def _flooded(tree: Path, kind: str) -> tuple[float, int, float, float]:
    """Return p99 of STOPs, how many were lost, p99 of setpoints' errors, and memory grown."""
    with introduced(tree, is_limited=True) as (it, client, rover), _flood(kind, it.port):
        times, lost = stops(lambda: stopped(client, rover), count=STOPS)
    with (
        simulated_rovers(ROVERS) as port,
        server(tree, port, "--arming=server", is_timed=True, is_limited=True) as it,
    ):
        drive(it, ROVERS)
        with _flood(kind, it.port):
            before, began = it.memory(), time.monotonic()
            time.sleep(SECONDS)
            grown = it.memory() - before
    errors = [error for _, at, error in it.results() if at >= began]
    return percentiles(times).p99, lost, percentiles(errors).p99, grown


@contextmanager
def _flood(kind: str, port: int) -> Iterator[None]:
    with beside(from_clients, kind, port, RATE) if kind else nullcontext():
        time.sleep(0.5)
        yield
