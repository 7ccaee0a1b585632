"""Floods a server's client link: ``PORT KIND RATE`` (datagrams/s), from its own socket.

It does not read the server's answers. A ``strangers`` flood keeps changing its sockets.
"""

import random
import socket
import sys
import time
from collections.abc import Callable
from itertools import count

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.packet import split_datagram
from mav_tasks.mavlink.signing import signed

from .child import HOST, READY, udp_socket
from .scripted import CLIENT, ground_station

BATCH = 20
AT_A_TIME = 64  # sockets of strangers at once
NAN = float("nan")
SECRET = b"nobody knows this key at all ..."


def _commands() -> Callable[[int], bytes]:
    encoder = Encoder(CLIENT)
    return lambda number: encoder.encode(
        m.CommandLong(1, 191, MavCmd.TASK_MOVE, 0, 1, 0, 0, number % 0xFFFFFF + 1, 0, 0, 5)
    )


def _broken() -> Callable[[int], bytes]:
    source = random.Random(1)  # the same noise in every run
    made = _commands()

    def broken(number: int) -> bytes:
        if number % 2:
            return source.randbytes(source.randrange(1, 300))
        raw = bytearray(made(number))
        raw[source.randrange(len(raw))] ^= 1 << source.randrange(8)
        return bytes(raw)

    return broken


def _uploads() -> Callable[[int], bytes]:
    """Start uploads and never continue them, each from another system id on one socket."""
    encoders = [Encoder(CLIENT._replace(system_id=number)) for number in range(1, 255)]
    return lambda number: encoders[number % 254].encode(
        m.MissionCount(1, (1, 191)[number % 2], 1000, number % 3)
    )


def _requests() -> Callable[[int], bytes]:
    """Request every message id, alternating between the highest rate and a single message."""
    encoder = Encoder(CLIENT)

    def request(number: int) -> bytes:
        wanted = number % 400
        if number % 2:
            command, interval = MavCmd.SET_MESSAGE_INTERVAL, 1.0  # µs
        else:
            command, interval = MavCmd.REQUEST_MESSAGE, 0.0
        return encoder.encode(m.CommandLong(1, 1, command, 0, wanted, interval, 0, 0, 0, 0, 0))

    return request


def _signatures() -> Callable[[int], bytes]:
    made = _commands()
    return lambda number: signed(made(number), SECRET, link_id=1, timestamp=number)


def _beats() -> Callable[[int], bytes]:
    encoder = Encoder(CLIENT)
    return lambda _: encoder.encode(ground_station())


KINDS: dict[str, Callable[[], Callable[[int], bytes]]] = {
    "commands": _commands,
    "broken": _broken,
    "uploads": _uploads,
    "requests": _requests,
    "signatures": _signatures,
    "strangers": _beats,
}


def main(port: int, kind: str, rate: float) -> None:
    """Send until the process is ended."""
    made = KINDS[kind]()
    assert kind == "broken" or len(split_datagram(made(0))) == 1
    sockets = [udp_socket()]
    print(READY, flush=True)
    begin = time.monotonic()
    for sent in count():
        if kind == "strangers" and sent % AT_A_TIME == 0:
            sockets = _others(sockets)
        sockets[sent % len(sockets)].sendto(made(sent), (HOST, port))
        ahead = begin + sent / rate - time.monotonic()
        if sent % BATCH == 0 and ahead > 0:
            time.sleep(ahead)


def _others(sockets: list[socket.socket]) -> list[socket.socket]:
    for each in sockets:
        each.close()
    return [udp_socket() for _ in range(AT_A_TIME)]


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], float(sys.argv[3]))
