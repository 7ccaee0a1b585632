"""Sends a vehicle's telemetry on an inherited socket: ``FD PORT RATE`` (datagrams/s)."""

import socket
import sys
import time

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.codec import Encoder

from .child import HOST, READY
from .scripted import VEHICLE

BATCH = 10


def main(fd: int, port: int, rate: float) -> None:
    """Send until the process is ended."""
    sock = socket.socket(fileno=fd)
    encoder = Encoder(VEHICLE)
    print(READY, flush=True)
    begin = time.monotonic()
    sent = 0
    while True:
        for _ in range(BATCH):
            boot = sent & 0xFFFFFF
            sock.sendto(encoder.encode(m.Attitude(boot, 0, 0, 0.1, 0, 0, 0)), (HOST, port))
            sent += 1
        ahead = begin + sent / rate - time.monotonic()
        if ahead > 0:
            time.sleep(ahead)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]))
