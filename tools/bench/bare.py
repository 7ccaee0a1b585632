"""The yardstick: ``bare.py [TO]`` echoes datagrams, or forwards them; it prints its port.

It imports nothing else, as asyncio's receive buffers cost half in a process with a larger heap.
"""

import asyncio
import sys
from typing import Any

HOST = "127.0.0.1"


class Forward(asyncio.DatagramProtocol):
    """Sends each datagram on: through another transport, or back by its own."""

    def __init__(self, out: Any = None, to: tuple[str, int] | None = None) -> None:
        self.out, self.to = out, to

    def connection_made(self, transport: Any) -> None:
        """Keep the transport for the answers."""
        self.out = self.out or transport

    def datagram_received(self, data: bytes, addr: Any) -> None:
        """Send the datagram."""
        self.out.sendto(data, self.to or addr)


async def serve(to: int = 0) -> None:
    """Echo what comes to a port, or send it to another port."""
    made = asyncio.get_running_loop().create_datagram_endpoint
    out: tuple[Any, ...] = (None, None)
    if to:
        transport, _ = await made(asyncio.DatagramProtocol, local_addr=(HOST, 0))
        out = transport, (HOST, to)
    transport, _ = await made(lambda: Forward(*out), local_addr=(HOST, 0))
    print("at", transport.get_extra_info("sockname")[1], flush=True)
    await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(serve(*map(int, sys.argv[1:])))
