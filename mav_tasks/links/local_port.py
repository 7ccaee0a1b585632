"""From which local port a rover is dialled on UDP: always the same one.

PX4's simulation answers the first sender that it heard, and nobody else until it restarts: who
dials from another port the next time is not answered. So the port follows from where the rover is.
"""

from zlib import crc32

#: below those that systems give out unasked (Linux: from 32768), beside those of autopilots (14xxx)
FIRST, COUNT = 16_000, 2_000


def port_for(host: str, port: int) -> int:
    """Return the local port for a rover; of neighbouring ports on one host no two share theirs."""
    return FIRST + (crc32(host.encode()) + port) % COUNT
