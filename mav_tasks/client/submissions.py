"""What a client remembers of its submissions, so that each is one task however often it is sent."""

from datetime import UTC, datetime
from random import SystemRandom

from mav_tasks.client import wire
from mav_tasks.tasks.task import MAX_NONCE

LATE_ACK = 3.0  # s, in which a copy of an ack may still come
REMEMBERED_IDS = 10_000
REMEMBERED_DELAYS = 1_000


class Submissions:
    """Nonces, ids and start times; ``now`` in monotonic seconds."""

    def __init__(self) -> None:
        self._nonces: dict[int, tuple[int, float]] = {}  # by task id; when that was
        self._delays: dict[int, float] = {}  # by nonce, of starts at a time of day
        self._last_nonce = SystemRandom().randrange(MAX_NONCE)

    def __repr__(self) -> str:
        return f"Submissions({len(self._nonces)} remembered)"

    def nonce(self, wished: int = 0) -> int:
        """Return the nonce wished for, or one not used yet: from a random one on, each once.

        All scripts of an address share one set of nonces. The server takes one for a copy until 10
        minutes after its task is over: two processes rarely draw the same of 10⁹ by then.
        """
        wire.check_nonce(wished)
        if wished:
            return wished
        self._last_nonce = self._last_nonce % MAX_NONCE + 1
        return self._last_nonce

    def note(self, task_id: int, nonce: int, *, now: float) -> None:
        """Take note of an id that was given to a submission."""
        self._nonces.pop(task_id, None)
        self._nonces[task_id] = nonce, now
        while len(self._nonces) > REMEMBERED_IDS:
            del self._nonces[next(iter(self._nonces))]

    def is_anothers(self, task_id: int, nonce: int, *, now: float) -> bool:
        """Whether an id is that of another submission of late: a copy of an old ack names it."""
        its_nonce, at = self._nonces.get(task_id, (nonce, 0.0))
        return its_nonce != nonce and now - at < LATE_ACK

    def delay(self, delay: float, at: datetime | None, nonce: int) -> float:
        """Return the seconds that a task must not run: a time of day is set once it is there.

        Again with the same nonce the same ones: else it were another task to the server.
        """
        if at is None:
            return delay
        known = self._delays.get(nonce)
        if known is None:
            known = max(delay, utc_of(at) - datetime.now(UTC).timestamp(), 0.0)
            self._delays[nonce] = known
            if len(self._delays) > REMEMBERED_DELAYS:
                del self._delays[next(iter(self._delays))]
        return known


def utc_of(at: datetime) -> float:
    """Return UTC seconds; ValueError for a time of day that is nobody's."""
    if at.tzinfo is None:
        raise ValueError(f"at {at}: a time of day without a time zone is nobody's")
    return at.timestamp()
