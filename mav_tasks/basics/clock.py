"""The server's clock: seconds since boot, including the time for which the machine was suspended.

asyncio's timers use CLOCK_MONOTONIC, which stops while a Linux machine is suspended: the server
would not notice the gap, and drive a rover on. Other systems have only CLOCK_MONOTONIC.
"""

import time

_CLOCK: int = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)


def boot_time() -> float:
    """Return the seconds since boot; the value never decreases."""
    return time.clock_gettime(_CLOCK)
