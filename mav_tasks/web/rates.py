"""How many requests a person or program may send: a token bucket for each. Pure but for time."""

import time
from collections import OrderedDict
from math import ceil

PER_SECOND = 200.0
AT_ONCE = 400.0
MOST = 1000  # buckets


class Rates:
    """The buckets."""

    def __init__(self) -> None:
        self._left: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def __repr__(self) -> str:
        return f"Rates({len(self._left)})"

    def wait_of(self, who: str) -> int:
        """Count a request. Return 0, or the seconds to wait if there were too many."""
        now = time.monotonic()
        left, at = self._left.pop(who, (AT_ONCE, now))
        left = min(AT_ONCE, left + (now - at) * PER_SECOND)
        is_too_many = left < 1.0
        self._left[who] = (left if is_too_many else left - 1.0), now
        while len(self._left) > MOST:
            self._left.popitem(last=False)
        return ceil((1.0 - left) / PER_SECOND) if is_too_many else 0
