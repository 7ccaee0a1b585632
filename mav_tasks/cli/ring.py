"""The key ring of a command, and the key that the command signs with."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

from mav_tasks.errors import KeyRingError

if TYPE_CHECKING:
    from mav_tasks.mavlink.signing import Key


def ring_path(asked: str) -> Path:
    """Return the file of ``--keys``; if "", the configured key ring, or the user's own."""
    from mav_tasks.config.configuration import Sources  # noqa: PLC0415
    from mav_tasks.key_ring.ring_file import path_of_ring  # noqa: PLC0415

    return path_of_ring(asked or Sources(None, dict(os.environ)).load().settings.links.keys)


def key_to_sign_with(name: str, asked: str) -> "Key":
    """Return a key by its name. Raise KeyRingError if there is none that is usable."""
    from mav_tasks.key_ring.ring_file import load  # noqa: PLC0415

    path = ring_path(asked)
    ring = load(path).ring
    try:
        return ring.usable_key(name)
    except KeyRingError as error:
        raise KeyRingError(f"--sign: {error}, in {path}") from None
