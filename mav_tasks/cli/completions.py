"""What the shell completes: values of options, and the options of the simulator.

Every function imports what it needs when it is called, because each call of the command line pays
for what this module imports.
"""

import sys
from collections.abc import Iterable
from typing import Any

from typer.core import TyperCommand

LONGEST = 5.0  # s for the help of another program


def beginning_with(typed: str, words: Iterable[str]) -> list[str]:
    """Return the words that begin with what was typed."""
    return [word for word in words if word.startswith(typed)]


def roles(incomplete: str) -> list[str]:
    """Return roles of keys."""
    from mav_tasks.key_ring.ring import KINDS  # noqa: PLC0415

    return beginning_with(incomplete, KINDS)


def derivations(incomplete: str) -> list[str]:
    """Return ways to make a key of a passphrase."""
    from mav_tasks.key_ring.derivation import PASSPHRASES  # noqa: PLC0415

    return beginning_with(incomplete, PASSPHRASES)


def releases(incomplete: str) -> list[str]:
    """Return what may become of a held task."""
    from typing import get_args  # noqa: PLC0415

    from mav_tasks.client.handle import Release  # noqa: PLC0415

    return beginning_with(incomplete, get_args(Release))


def settings(incomplete: str) -> list[str]:
    """Return keys of the configuration, as ``--set`` takes them."""
    from mav_tasks.settings import KEYS  # noqa: PLC0415

    return beginning_with(incomplete, [f"{name}=" for name in KEYS])


def key_names(incomplete: str) -> list[str]:
    """Return names of usable keys of the key ring; none if it cannot be read."""
    from mav_tasks.cli.ring import ring_path  # noqa: PLC0415
    from mav_tasks.errors import MavTasksError  # noqa: PLC0415
    from mav_tasks.key_ring.ring_file import load  # noqa: PLC0415

    try:
        ring = load(ring_path("")).ring
    except MavTasksError:
        return []
    return beginning_with(incomplete, [entry.name for entry in ring.entries if entry.is_usable])


class HandedOver(TyperCommand):
    """A command of another program, whose help names its options and their choices."""

    program = ""  # a module

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """Return options, or the choices of the option that was typed before."""
        import re  # noqa: PLC0415
        from types import SimpleNamespace  # noqa: PLC0415

        told = _help_of(self.program)
        choices = dict(re.findall(r"(--[a-z-]+) \{([^}]*)\}", told))
        before = ctx.args[-1] if ctx.args else ""
        if not incomplete.startswith("-") and before in choices:
            words = choices[before].split(",")
        else:
            words = sorted(set(re.findall(r"--[a-z][a-z-]*", told)))
        return [
            SimpleNamespace(type="plain", value=word, help=None)
            for word in beginning_with(incomplete, words)
        ]


class SimCommand(HandedOver):
    """``mav-tasks sim``."""

    program = "rover_sim"


class DemoCommand(HandedOver):
    """``mav-tasks demo``."""

    program = "rover_sim.demo"


def _help_of(program: str) -> str:
    import subprocess  # noqa: PLC0415

    command = [sys.executable, "-m", program, "--help"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout
