"""The local UDP port from which a rover is dialled: always the same one.

PX4's simulation answers only the first sender that it heard, until it restarts. A server that dials
from another port the next time gets no answer. So the port is computed from the rover's address.
"""

from zlib import crc32

#: below the ephemeral ports (Linux: from 32768), and above those of autopilots (14xxx)
FIRST, COUNT = 16_000, 2_000


def port_for(host: str, port: int) -> int:
    """Return the local port for a rover; neighbouring ports of one host get different ones."""
    return FIRST + (crc32(host.encode()) + port) % COUNT
