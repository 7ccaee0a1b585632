"""The entries of a key ring. A revoked entry stays, marked as revoked.

So a ring whose only key was revoked is not empty, and a revoked key cannot be added again by
mistake. The secret of a revoked key is retired: no packet is signed with it or accepted by it, but
records of earlier runs can be replayed.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import datetime

from mav_tasks.basics.errors import KeyRingError
from mav_tasks.config.settings import ROLES, Limits
from mav_tasks.mavlink.signing import Key

VEHICLE = "vehicle"  # kind of a key of vehicles; it gives a client no rights
KINDS = (*ROLES, VEHICLE)
MOST_KEYS = 64  # usable keys; each is tried on a packet from an unknown sender
#: names that TOML, a link URL and a command line accept without quotes
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,31}")
NAMES = "expected 1 to 32 letters, digits, - and _, beginning with a letter or digit"


@dataclass(frozen=True, slots=True)
class Entry:
    """One key with its metadata; ``kind`` is a role, or VEHICLE.

    ``limits`` of its holder, beside those of the role; None: no others. The key has them, too.
    """

    name: str
    kind: str
    key: Key = field(repr=False)
    derivation: str = ""
    created: datetime | None = None
    revoked: datetime | None = None
    retired: bytes = field(default=b"", repr=False)  # the secret of a revoked key
    limits: Limits | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "key", replace(self.key, limits=self.limits))

    @property
    def is_usable(self) -> bool:
        """Whether the key is not revoked."""
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
        """The keys that are not revoked."""
        return tuple(entry.key for entry in self.entries if entry.is_usable)

    @property
    def secrets(self) -> dict[str, bytes]:
        """All secrets by fingerprint, also retired ones: only for replays."""
        secrets = {
            entry.key.fingerprint: entry.key.secret or entry.retired for entry in self.entries
        }
        return {fingerprint: secret for fingerprint, secret in secrets.items() if secret}

    def usable_key(self, name: str) -> Key:
        """Return a key to sign with; raise KeyRingError if it is missing or revoked."""
        entry = self._entry(name)
        if not entry.is_usable:
            raise KeyRingError(f"key {name} was revoked{_on(entry.revoked)}")
        return entry.key

    def with_added(self, entry: Entry) -> "KeyRing":
        """Return the ring with one more entry; raise KeyRingError if known, or the ring is full."""
        for each in self.entries:
            if each.name == entry.name:
                was = f"was revoked{_on(each.revoked)}" if each.revoked else "exists already"
                raise KeyRingError(f"key {entry.name} {was}: choose another name")
            if each.key.fingerprint == entry.key.fingerprint:
                was = "was revoked" if each.revoked else "exists already"
                raise KeyRingError(f"key {entry.name}: this secret {was}, as key {each.name}")
        if entry.limits is not None and entry.kind == VEHICLE:
            raise KeyRingError(f"key {entry.name}: the key of a rover has no limits")
        if entry.is_usable and len(self.usable) >= MOST_KEYS:
            raise KeyRingError(f"key {entry.name}: the key ring is full, {MOST_KEYS} keys")
        return KeyRing((*self.entries, entry))

    def with_revoked(self, name: str, *, at: datetime) -> "KeyRing":
        """Return the ring with a key revoked; raise KeyRingError if it is missing or revoked."""
        key = self.usable_key(name)
        bare = Key(name, b"", role=key.role, fingerprint=key.fingerprint)
        return self._with(name, lambda it: replace(it, key=bare, revoked=at, retired=key.secret))

    def with_forgotten(self, name: str) -> "KeyRing":
        """Return the ring without a revoked key's secret; raise KeyRingError if it is in use."""
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
        raise KeyRingError(f"no key {name!a} (usable keys: {there or 'none'})")


def key_of(name: str, kind: str, secret: bytes) -> Key:
    """Return the key of an entry; its role is "" if its kind is VEHICLE.

    Raise KeyRingError for an invalid name or kind.
    """
    if not NAME.fullmatch(name):
        raise KeyRingError(f"{name[:40]!a} is not a key name: {NAMES}")
    if kind not in KINDS:
        raise KeyRingError(f"key {name}: expected a role, one of {', '.join(KINDS)}")
    return Key(name, secret, role="" if kind == VEHICLE else kind)


def _on(date: datetime | None) -> str:
    return "" if date is None else f" on {date:%Y-%m-%d}"
