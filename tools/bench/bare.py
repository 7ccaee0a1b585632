"""The baseline: asyncio's own UDP endpoints that only echo or forward.

``python -m tools.bench.bare echo PORT`` · ``python -m tools.bench.bare forward PORT TO_PORT``
"""

import asyncio
import signal
import sys
from typing import cast

from .child import HOST, READY


class Echo(asyncio.DatagramProtocol):
    """Sends each datagram back."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the transport for the answers."""
        self._transport = cast(asyncio.DatagramTransport, transport)  # in 3.11 only in fact

    def datagram_received(self, data: bytes, addr: tuple[str | int, int]) -> None:
        """Send the datagram back."""
        self._transport.sendto(data, addr)


class Forward(asyncio.DatagramProtocol):
    """Forwards each datagram through another socket."""

    def __init__(self, out: asyncio.DatagramTransport, to: tuple[str, int]) -> None:
        self._out = out
        self._to = to

    def datagram_received(self, data: bytes, _addr: tuple[str | int, int]) -> None:
        """Forward the datagram."""
        self._out.sendto(data, self._to)


async def _serve(kind: str, port: int, to_port: int) -> None:
    loop = asyncio.get_running_loop()
    over = asyncio.Event()
    loop.add_signal_handler(signal.SIGTERM, over.set)
    if kind == "echo":
        await loop.create_datagram_endpoint(Echo, local_addr=(HOST, port))
    else:
        out, _ = await loop.create_datagram_endpoint(asyncio.DatagramProtocol, local_addr=(HOST, 0))
        await loop.create_datagram_endpoint(
            lambda: Forward(out, (HOST, to_port)), local_addr=(HOST, port)
        )
    print(READY, flush=True)
    await over.wait()


if __name__ == "__main__":
    asyncio.run(_serve(sys.argv[1], int(sys.argv[2]), int(sys.argv[-1])))
