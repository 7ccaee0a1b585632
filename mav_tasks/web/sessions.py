"""Logins of browsers: a random id in a cookie stands for a token. A restart ends them."""

import secrets
import time
from collections import OrderedDict

from mav_tasks.web.tokens import Token, Tokens

COOKIE = "mav_tasks_session"
LASTS = 12 * 3600.0  # s
MOST = 1000
MOST_OF_A_TOKEN = 20  # so that nobody's logins end those of others
BYTES = 32


class Sessions:
    """The open sessions. A session ends with its token."""

    def __init__(self, tokens: Tokens) -> None:
        self._tokens = tokens
        self._open: OrderedDict[str, tuple[Token, float]] = OrderedDict()

    def __repr__(self) -> str:
        return f"Sessions({len(self._open)})"

    def begin(self, token: Token) -> str:
        """Return the id of a new session. End the token's oldest ones if it has too many."""
        its_own = [number for number, (other, _) in self._open.items() if other == token]
        for number in its_own[: len(its_own) + 1 - MOST_OF_A_TOKEN]:
            del self._open[number]
        while len(self._open) >= MOST:
            self._open.popitem(last=False)
        number = secrets.token_urlsafe(BYTES)
        self._open[number] = token, time.monotonic() + LASTS
        return number

    def token_of(self, number: str) -> Token | None:
        """Return the token of a session; None if there is no such session, or it has ended."""
        token, until = self._open.get(number, (None, 0.0))
        if token is None or time.monotonic() > until or not self._tokens.is_valid(token):
            self._open.pop(number, None)
            return None
        return token

    def end(self, number: str) -> None:
        """End a session."""
        self._open.pop(number, None)
