"""Processes that bear measuring: a bare echo or forwarder, and a server of any revision.

``child.py bare [TO]`` echoes datagrams, or forwards them to a port; it prints its own. It imports
nothing else, as asyncio's receive buffers cost half in a process with a larger heap.

``child.py serve …`` is ``mav-tasks serve …``. At its end it prints when setpoints left, as JSON:
triples of a rover's system id, monotonic time, and the seconds since the moving setpoint before.
The zero that ends a drive leaves at once and is not counted.
"""

import asyncio
import json
import sys
import time
from typing import Any

HOST = "127.0.0.1"
MOVING = 0.1  # s; after a longer interval the stream had ended
SETPOINT = 84  # SET_POSITION_TARGET_LOCAL_NED
FORWARD = slice(10 + 16, 10 + 20)  # offset of vx, and of target_system,
TARGET_SYSTEM = 10 + 50  # in a whole MAVLink 2 packet of it


class Bare(asyncio.DatagramProtocol):
    """Sends each datagram on, or back."""

    def __init__(self, *to: tuple[str, int]) -> None:
        self.to = to

    def connection_made(self, transport: Any) -> None:
        """Keep the transport, and tell its port."""
        self.transport = transport
        print("at", transport.get_extra_info("sockname")[1], flush=True)

    def datagram_received(self, data: bytes, addr: Any) -> None:
        """Send the datagram."""
        self.transport.sendto(data, *self.to or (addr,))


async def bare(*to: str) -> None:
    """Echo what comes to a port, or send it to another port."""
    made = asyncio.get_running_loop().create_datagram_endpoint
    await made(lambda: Bare(*((HOST, int(port)) for port in to)), local_addr=(HOST, 0))
    await asyncio.Event().wait()


def serve() -> None:
    """Run the command line, and note when setpoints leave."""
    from mav_tasks.cli.app import main  # noqa: PLC0415  # not for an echo
    from mav_tasks.links.udp import UdpLink  # noqa: PLC0415

    left: list[tuple[int, float, float]] = []
    last: dict[int, float] = {}
    send = UdpLink.send

    def timed(link: UdpLink, peer: Any, data: bytes) -> None:
        send(link, peer, data)
        if data[7] == SETPOINT and data[8] == 0 and len(data) > TARGET_SYSTEM:
            rover, now = data[TARGET_SYSTEM], time.monotonic()
            interval = now - last.pop(rover, 0.0)
            if any(data[FORWARD]):
                last[rover] = now
                if interval < MOVING:
                    left.append((rover, now, interval))

    UdpLink.send = timed  # type: ignore[method-assign, assignment]
    try:
        main()
    finally:
        print(json.dumps(left), flush=True)


if __name__ == "__main__":
    if sys.argv[1] == "bare":
        asyncio.run(bare(*sys.argv[2:]))
    else:
        serve()
