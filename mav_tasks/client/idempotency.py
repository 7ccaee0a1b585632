"""An idempotency key as the numbers that the task server compares. Pure.

A nonce has 30 bits, and all clients of one MAVLink address and key share them. With 1,000 tasks
remembered, a new key meets the nonce of another one once in a million submissions. So 31 more bits
of the key, with what the plan does not say, go into the plan: the server compares them with the
rest of it, and refuses a key that only looks like another one. It never takes one task for the
other.
"""

from hashlib import sha256
from typing import NamedTuple

from mav_tasks.client.terms import CommonTerms
from mav_tasks.client.wire import repeat_of
from mav_tasks.kinds.sent import LARGEST
from mav_tasks.tasks.task import MAX_NONCE

LONGEST = 200  # characters of a key


class Numbers(NamedTuple):
    """The nonce of a key, and the check that goes with it."""

    nonce: int
    check: int


def numbers_of(key: str, terms: CommonTerms) -> Numbers:
    """Return the numbers of a key; the check depends on the terms that a plan does not carry.

    They are set after the submission: the server does not compare them itself. The same terms in
    other words have the same numbers. Raise ValueError for a bad repetition.
    """
    rest, at = [terms.get("label") or ""], terms.get("at")
    if repeat := repeat_of(terms.get("every") or 0):
        rest += [repeat, f"{terms['deadline']:g}"] if terms.get("deadline") else [repeat]
    if at is not None:
        rest.append(f"at {at.timestamp():.0f}")
    nonce = int.from_bytes(sha256(key.encode()).digest()[:16]) % MAX_NONCE + 1
    whole = sha256(" ".join((f"{len(key)}", key, "\0".join(rest))).encode()).digest()
    return Numbers(nonce, int.from_bytes(whole[:16]) % LARGEST + 1)
