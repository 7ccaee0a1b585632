"""The server that a store belongs to, as the store itself names it in the row of ``writer``."""

import time
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Holder:
    """The server that opened the store last; ``epoch`` 0: none has. ``since`` is UTC seconds."""

    epoch: int
    host: str
    pid: int
    since: float

    def __str__(self) -> str:
        since = time.strftime("%Y-%m-%d %H:%M:%SZ", time.gmtime(self.since))
        return f"the server on {self.host}, pid {self.pid}, since {since}"


class Replaced(Exception):
    """The store is no longer this server's. The text is one line, and stays true."""


def words_for(holder: Holder | None) -> str:
    """Return the words for the server that has the store for itself."""
    return str(holder) if holder is not None and holder.epoch else "another server"
