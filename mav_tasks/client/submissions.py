"""The nonces of a client's submissions: a submission is one task, however often it is sent."""

from datetime import UTC, datetime
from random import SystemRandom

from mav_tasks.basics.latest import keep_latest
from mav_tasks.client import wire
from mav_tasks.tasks.task import MAX_DELAY, MAX_NONCE

LATE_ACK = 3.0  # s for which a copy of an ack may still arrive
REMEMBERED_IDS = 10_000
REMEMBERED_DELAYS = 1_000


class Submissions:
    """The nonces, task ids and start delays of submissions; ``now`` in monotonic seconds."""

    def __init__(self) -> None:
        self._nonces: dict[int, tuple[int, float]] = {}  # by task id; with the time
        self._delays: dict[int, float] = {}  # s, by nonce, of submissions with ``at``
        self._last_nonce = SystemRandom().randrange(MAX_NONCE)

    def __repr__(self) -> str:
        return f"Submissions({len(self._nonces)} remembered)"

    def nonce(self, wished: int = 0) -> int:
        """Return ``wished``, 0: the next unused nonce. The first one is random.

        All scripts of one address share a set of nonces. The server treats a repeated nonce as a
        copy until 10 minutes after its task has ended. Two processes rarely draw the same of 10⁹
        nonces within that time.
        """
        wire.check_nonce(wished)
        if wished:
            return wished
        self._last_nonce = self._last_nonce % MAX_NONCE + 1
        return self._last_nonce

    def note(self, task_id: int, nonce: int, *, now: float) -> None:
        """Remember the task id of a submission."""
        keep_latest(self._nonces, task_id, (nonce, now), most=REMEMBERED_IDS)

    def is_anothers(self, task_id: int, nonce: int, *, now: float) -> bool:
        """Return whether another submission got this id just now: a late copy of its ack."""
        its_nonce, at = self._nonces.get(task_id, (nonce, 0.0))
        return its_nonce != nonce and now - at < LATE_ACK

    def delay(self, delay: float, at: datetime | None, nonce: int) -> float:
        """Return the start delay, s. For ``at`` it bridges the time until START_UTC is set.

        The same nonce gets the same delay: with another one the server would see another task.
        Raise ValueError for a time that is too far ahead.
        """
        if at is None:
            return delay
        known = self._delays.get(nonce)
        if known is None:
            known = max(delay, utc_of(at) - datetime.now(UTC).timestamp(), 0.0)
            if known > MAX_DELAY:
                raise ValueError(f"at {at}: more than a year ahead")
            keep_latest(self._delays, nonce, known, most=REMEMBERED_DELAYS)
        return known


def utc_of(at: datetime) -> float:
    """Return UTC seconds. Raise ValueError if ``at`` has no time zone."""
    if at.tzinfo is None:
        raise ValueError(f"at {at}: a datetime needs a time zone")
    return at.timestamp()
