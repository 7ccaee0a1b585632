"""The key ring of a command, and the key that the command signs with."""

import os
from pathlib import Path

from mav_tasks.basics.errors import KeyRingError, MavTasksError
from mav_tasks.config.configuration import Sources
from mav_tasks.config.key_ring.ring_file import load, path_of_ring
from mav_tasks.mavlink.signing import Key


def ring_path(asked: str) -> Path:
    """Return the file of ``--keys``; if "", the configured key ring, or the user's own."""
    return path_of_ring(asked or Sources(None, dict(os.environ)).load().settings.links.keys)


def key_to_sign_with(name: str, asked: str) -> Key:
    """Return a key by its name. Raise KeyRingError if there is none that is usable."""
    path = ring_path(asked)
    ring = load(path).ring
    try:
        return ring.usable_key(name)
    except KeyRingError as error:
        raise KeyRingError(f"--sign: {error}, in {path}") from None


def key_names() -> list[str]:
    """Return the names of the usable keys of the key ring; none if it cannot be read."""
    try:
        ring = load(ring_path("")).ring
    except MavTasksError:
        return []
    return [entry.name for entry in ring.entries if entry.is_usable]
