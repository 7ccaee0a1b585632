"""The datagrams that wait, for two threads: the loop puts them in, the carrier's takes them out."""

from collections.abc import Iterable
from threading import Lock

from mav_tasks.basics.mailbox import Mailbox
from mav_tasks.fleet.outbox import Outbox, Pressing, Waiting


class SharedOutbox:
    """An ``Outbox`` under a lock; its descriptor tells that something has been put in."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._outbox = Outbox()
        self._bell: Mailbox[None] = Mailbox(replaces=lambda _earlier, _later: True)
        self._has_rung = False  # and nothing was taken since

    def __repr__(self) -> str:
        return f"SharedOutbox({self._outbox})"

    def put(self, to: str, item: Waiting) -> None:
        """Add a datagram; wake the carrier's thread, unless it has been woken for an ordinary one.

        Several ordinary ones then leave together, while one that is first does not wait for that.
        """
        with self._lock:
            self._outbox.put(to, item)
            is_to_ring = item.first or not self._has_rung
            self._has_rung = True
        if is_to_ring:
            self._bell.put(None)

    def ring(self) -> None:
        """Wake the carrier's thread."""
        self._bell.put(None)

    def fileno(self) -> int:
        """Return the descriptor that is readable after a ring, until ``quiet``."""
        fileno = self._bell.fileno()
        assert fileno is not None
        return fileno

    def quiet(self) -> None:
        """End the ring."""
        self._bell.take()

    def close(self) -> None:
        """Close the descriptor."""
        self._bell.close()

    def meet(self, names: frozenset[str], *, now: float) -> None:
        """Take which gateways can be reached now."""
        with self._lock:
            self._has_rung = False
            self._outbox.meet(names, now=now)

    def renew(self, *, now: float) -> None:
        """A connection begins: what is first waited only because there was none."""
        with self._lock:
            self._outbox.renew(now=now)

    def put_back(self, to: str, items: Iterable[Waiting]) -> None:
        """Put datagrams that are first back."""
        with self._lock:
            self._outbox.put_back(to, items)

    def take(self, to: str, room: int, *, each: int, now: float) -> list[Waiting]:
        """Remove and return what may leave now."""
        with self._lock:
            return self._outbox.take(to, room, each=each, now=now)

    def pressing(self) -> Pressing:
        """Return how soon something must leave."""
        with self._lock:
            return self._outbox.pressing()

    @property
    def dropped(self) -> int:
        """The datagrams that were dropped because too many waited."""
        return self._outbox.dropped

    @property
    def expired(self) -> int:
        """The datagrams that could not leave in time."""
        return self._outbox.expired
