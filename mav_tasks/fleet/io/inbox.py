"""What has arrived from other gateways and waits for the event loop, for two threads.

The loop may stand still while the carrier's thread reads on. So what is first overtakes the rest
here, too; the time for which a datagram waits here counts; and what is too late then is dropped.
"""

from collections import deque
from dataclasses import replace
from math import inf
from threading import Lock

from mav_tasks.basics.mailbox import Mailbox
from mav_tasks.fleet.exchange import Arrived
from mav_tasks.fleet.io.keeper import Trouble

LIMIT = 10_000  # ordinary datagrams; later ones are dropped


class Inbox:
    """A list of datagrams and troubles; its descriptor is readable while it is not empty."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._first: deque[Arrived] = deque()
        self._others: deque[Arrived | Trouble] = deque()
        self._bell: Mailbox[None] = Mailbox(replaces=lambda _earlier, _later: True)
        self.unread = 0  # datagrams that were dropped because too many waited
        self.late = 0  # datagrams that were of no use any more when the loop came to them

    def __repr__(self) -> str:
        return f"Inbox({len(self._first)} first, {len(self._others)} others)"

    def put(self, item: Arrived | Trouble) -> None:
        """Add a datagram, or a trouble."""
        with self._lock:
            if isinstance(item, Arrived) and item.first:
                self._first.append(item)
            elif isinstance(item, Trouble) or len(self._others) < LIMIT:
                self._others.append(item)
            else:
                self.unread += 1
                return
            self._bell.put(None)

    def put_mistake(self, mistake: BaseException) -> None:
        """Let ``take`` raise an exception, which is a bug of ours."""
        self._bell.put_mistake(mistake)

    def take(self, most: float = inf, *, now: float) -> list[Arrived | Trouble]:
        """Remove and return up to ``most``, those that are first before; raise a mistake."""
        found: list[Arrived | Trouble] = []
        with self._lock:
            self._bell.take()
            for waiting in (self._first, self._others):
                while waiting and len(found) < most:
                    item = waiting.popleft()
                    if isinstance(item, Trouble):
                        found.append(item)
                    elif item.first or now <= item.until:
                        found.append(replace(item, at=now, waited=item.waited + now - item.at))
                    else:
                        self.late += 1
            if self._first or self._others:
                self._bell.put(None)
        return found

    def fileno(self) -> int | None:
        """Return the descriptor; None once it is closed."""
        return self._bell.fileno()

    def close(self) -> None:
        """Close the descriptor."""
        self._bell.close()
