"""The server's clock: seconds since the machine was started, also of those in which it was asleep.

CLOCK_MONOTONIC, which asyncio's timers go by, does not count a suspended machine on Linux: a rover
would be driven on after it as if nothing had been. Elsewhere CLOCK_MONOTONIC is what there is.
"""

import time

_CLOCK: int = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)


def boot_time() -> float:
    """Return the seconds since the machine was started; it never goes back."""
    return time.clock_gettime(_CLOCK)
