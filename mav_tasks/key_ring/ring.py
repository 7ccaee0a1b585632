"""What a key ring holds. An entry that was revoked stays: it is known as such.

So a ring whose only key was revoked is still a ring, and that key cannot come back by mistake. Its
secret is retired: nothing is signed or believed by it, but the records of runs in which it counted
can be replayed.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import datetime

from mav_tasks.errors import KeyRingError
from mav_tasks.mavlink.signing import Key
from mav_tasks.settings import ROLES

VEHICLE = "vehicle"  # of a key that vehicles sign with; no client has rights by it
KINDS = (*ROLES, VEHICLE)
MOST_KEYS = 64  # with a secret; each is tried on a packet of somebody unknown
#: as TOML, a link URL and a command line take it without quotes
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,31}")
NAMES = "expected 1 to 32 letters, digits, - and _, a letter or digit first"


@dataclass(frozen=True, slots=True)
class Entry:
    """One key with what is known of it; ``kind`` is a role, or VEHICLE."""

    name: str
    kind: str
    key: Key = field(repr=False)
    derivation: str = ""
    created: datetime | None = None
    revoked: datetime | None = None
    retired: bytes = field(default=b"", repr=False)  # the secret of a revoked key

    @property
    def is_usable(self) -> bool:
        """Whether packets may be signed with it."""
        return bool(self.key.secret)


@dataclass(frozen=True, slots=True)
class KeyRing:
    """Entries in the order in which they were added."""

    entries: tuple[Entry, ...] = ()

    @property
    def keys(self) -> tuple[Key, ...]:
        """All keys; revoked ones have no secret."""
        return tuple(entry.key for entry in self.entries)

    @property
    def usable(self) -> tuple[Key, ...]:
        """Those that packets may be signed with."""
        return tuple(entry.key for entry in self.entries if entry.is_usable)

    @property
    def secrets(self) -> dict[str, bytes]:
        """All secrets by fingerprint, the retired ones too: for replays, and nothing else."""
        secrets = {
            entry.key.fingerprint: entry.key.secret or entry.retired for entry in self.entries
        }
        return {fingerprint: secret for fingerprint, secret in secrets.items() if secret}

    def usable_key(self, name: str) -> Key:
        """Return a key to sign with; KeyRingError says why there is none."""
        entry = self._entry(name)
        if not entry.is_usable:
            raise KeyRingError(f"key {name} was revoked{_on(entry.revoked)}")
        return entry.key

    def with_added(self, entry: Entry) -> "KeyRing":
        """Return the ring with one more entry; KeyRingError says why it cannot be in it."""
        for each in self.entries:
            if each.name == entry.name:
                was = f"was revoked{_on(each.revoked)}" if each.revoked else "is there already"
                raise KeyRingError(f"key {entry.name} {was}: choose another name")
            if each.key.fingerprint == entry.key.fingerprint:
                was = "was revoked" if each.revoked else "is there already"
                raise KeyRingError(f"key {entry.name}: this secret {was}, as key {each.name}")
        if entry.is_usable and len(self.usable) >= MOST_KEYS:
            raise KeyRingError(f"key {entry.name}: there are {MOST_KEYS} keys already")
        return KeyRing((*self.entries, entry))

    def with_revoked(self, name: str, *, at: datetime) -> "KeyRing":
        """Return the ring in which nobody signs with a key any more. KeyRingError."""
        secret = self.usable_key(name).secret
        return self._with(
            name, lambda it: replace(it, key=without_secret(it.key), revoked=at, retired=secret)
        )

    def with_forgotten(self, name: str) -> "KeyRing":
        """Return the ring without the secret of a revoked key. KeyRingError if it is in use."""
        if self._entry(name).is_usable:
            raise KeyRingError(f"key {name} is in use: revoke it first")
        return self._with(name, lambda it: replace(it, retired=b""))

    def _with(self, name: str, changed: Callable[[Entry], Entry]) -> "KeyRing":
        return KeyRing(tuple(changed(each) if each.name == name else each for each in self.entries))

    def _entry(self, name: str) -> Entry:
        for entry in self.entries:
            if entry.name == name:
                return entry
        there = ", ".join(entry.name for entry in self.entries if entry.is_usable)
        raise KeyRingError(f"no key {name!a}: there is {there or 'none'}")


def key_of(name: str, kind: str, secret: bytes) -> Key:
    """Return the key of an entry: what its holder may do is nothing to clients if vehicles have it.

    KeyRingError: it cannot be named so, or there is no such role.
    """
    if not NAME.fullmatch(name):
        raise KeyRingError(f"{name[:40]!a}: no name of a key: {NAMES}")
    if kind not in KINDS:
        raise KeyRingError(f"key {name}: expected a role, one of {', '.join(KINDS)}")
    return Key(name, secret, role="" if kind == VEHICLE else kind)


def without_secret(key: Key) -> Key:
    """Return a key as it is once it was revoked."""
    return Key(key.name, b"", role=key.role, fingerprint=key.fingerprint)


def _on(date: datetime | None) -> str:
    return "" if date is None else f" on {date:%Y-%m-%d}"
