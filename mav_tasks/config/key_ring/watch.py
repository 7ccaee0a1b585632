"""Watches the key ring of a running server: a change of the file takes effect at once.

A thread polls and reads the file: a stuck disk must not delay a setpoint. If the ring is invalid or
missing, the keys in force stay, so that a fault never gives access.
"""

import asyncio
import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from mav_tasks.basics.errors import KeyRingError
from mav_tasks.config.key_ring.limits import limits_in_words
from mav_tasks.config.key_ring.ring import VEHICLE
from mav_tasks.config.key_ring.ring_file import Loaded, Mark, load, mark_of
from mav_tasks.mavlink.signing import Key

log = logging.getLogger("mav_tasks")

LOOK = 0.1  # s between two polls of the file
AGAIN = 10  # polls, after which an unreadable file is read again though it is unchanged

#: puts keys into force
Put = Callable[[tuple[Key, ...]], None]


class RingWatch:
    """Watches one file; call ``begin`` and ``close`` in the loop's thread."""

    def __init__(self, path: Path, loaded: Loaded | None) -> None:
        """``loaded``: the ring in force; None: there was no file."""
        self.path = path
        #: the keys in force; None: there is no ring
        self.keys = None if loaded is None else loaded.ring.keys
        self._mark: Mark | None = None if loaded is None else loaded.mark
        self._is_over = threading.Event()

    def __repr__(self) -> str:
        keys = "no ring" if self.keys is None else f"{len(self.keys)} keys"
        return f"RingWatch({self.path}, {keys})"

    def begin(self, put: Put) -> None:
        """Start the thread, and call ``put`` in the loop with the keys after each change."""
        loop = asyncio.get_running_loop()
        # A daemon thread: a stuck disk must not keep the server from ending.
        threading.Thread(target=self._watch, args=(loop, put), name="key ring", daemon=True).start()

    def close(self) -> None:
        self._is_over.set()

    # in the thread

    def _watch(self, loop: asyncio.AbstractEventLoop, put: Put) -> None:
        looker = _Looker(self.path, self._mark)
        with suppress(RuntimeError):  # the loop has ended meanwhile
            while not self._is_over.wait(LOOK):
                news = looker.look()
                if news is not None:
                    loop.call_soon_threadsafe(self._take, news, put)

    # in the loop

    def _take(self, news: tuple[Key, ...] | str, put: Put) -> None:
        if self._is_over.is_set():
            return
        if isinstance(news, str):
            still = "the server has no keys" if self.keys is None else "the keys in force stay"
            log.error("%s: %s", news, still)
            return
        before, self.keys = self.keys, news
        if news == before:
            log.info("key ring %s: valid, no changes", self.path)
            return
        put(news)
        for words in changes(before or (), news):
            log.warning("key ring: %s", words)


class _Looker:
    """Polls a file, and remembers what it found."""

    def __init__(self, path: Path, mark: Mark | None) -> None:
        self._path = path
        self._mark = mark
        self._is_settled = True
        self._fault = ""
        self._keys: tuple[Key, ...] | None = None
        self._was_there = mark is not None
        self._looks = 0  # polls since the file was read

    def look(self) -> tuple[Key, ...] | str | None:
        """Return the keys if the file has changed, a text if it cannot be read, else None."""
        self._looks += 1
        try:
            mark = mark_of(self._path.stat())
        except FileNotFoundError:
            return self._failed(f"key ring {self._path} was removed") if self._was_there else None
        except OSError as error:
            return self._failed(f"key ring {self._path}: {error.strerror}")
        is_due = bool(self._fault) and self._looks >= AGAIN
        if mark == self._mark and self._is_settled and not is_due:
            return None
        self._looks = 0
        # Read a changed file again at the next poll, even if its mark is the same: it may have been
        # written twice within one tick of the file system's clock.
        is_same, self._is_settled = mark == self._mark, mark == self._mark
        self._mark, self._was_there = mark, True
        try:
            keys = load(self._path).ring.keys
        except KeyRingError as error:
            return self._failed("; ".join(error.faults))
        except Exception:  # a bug of ours must not end the watch
            log.exception("key ring: internal error")
            return self._failed(f"key ring {self._path} could not be read")
        was_faulty, self._fault = bool(self._fault), ""
        if is_same and keys == self._keys and not was_faulty:
            return None
        self._keys = keys
        return keys

    def _failed(self, words: str) -> str | None:
        if words == self._fault:
            return None
        self._fault = words
        return words


def changes(before: tuple[Key, ...], after: tuple[Key, ...]) -> Iterator[str]:
    """Yield a text for each key that differs, by name."""
    old, new = ({key.name: key for key in keys} for keys in (before, after))
    for name in sorted(old.keys() | new.keys()):
        was, now = old.get(name), new.get(name)
        if was == now:
            continue
        if now is None:
            yield f"key {name} was removed"
        elif not now.secret:
            yield f"key {name} was revoked"
        elif was is None:
            yield f"key {name} was added, {_rights(now)}"
        elif was.fingerprint != now.fingerprint or not was.secret:
            yield f"key {name} has a new secret, {_rights(now)}"
        else:
            yield f"key {name} has {_rights(now)} now"


def _rights(key: Key) -> str:
    limits = limits_in_words(key.limits)
    return f"role {key.role or VEHICLE}{f' ({limits})' if limits else ''}"
