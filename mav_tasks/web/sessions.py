"""Logins of browsers: a random id in a cookie stands for a key. A restart ends them."""

import secrets
import time
from collections import OrderedDict

from mav_tasks.mavlink.signing import Key
from mav_tasks.web.users import Users

COOKIE = "mav_tasks_session"
LASTS = 12 * 3600.0  # s
MOST = 1000
MOST_OF_A_KEY = 20  # so that nobody's logins end those of others
BYTES = 32


class Sessions:
    """The open sessions. A session ends with its key."""

    def __init__(self, users: Users) -> None:
        self._users = users
        self._open: OrderedDict[str, tuple[Key, float]] = OrderedDict()

    def __repr__(self) -> str:
        return f"Sessions({len(self._open)})"

    def begin(self, key: Key) -> str:
        """Return the id of a new session. End the key's oldest ones if it has too many."""
        its_own = [number for number, (other, _) in self._open.items() if other == key]
        for number in its_own[: len(its_own) + 1 - MOST_OF_A_KEY]:
            del self._open[number]
        while len(self._open) >= MOST:
            self._open.popitem(last=False)
        number = secrets.token_urlsafe(BYTES)
        self._open[number] = key, time.monotonic() + LASTS
        return number

    def key_of(self, number: str) -> Key | None:
        """Return the key of a session; None if there is no such session, or it has ended."""
        key, until = self._open.get(number, (None, 0.0))
        if key is None or time.monotonic() > until or not self._users.has(key):
            self._open.pop(number, None)
            return None
        return key

    def end(self, number: str) -> None:
        """End a session."""
        self._open.pop(number, None)
