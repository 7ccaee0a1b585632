"""A command that is a program of its own: the demonstration."""

import os
import re
import subprocess
import sys
from types import SimpleNamespace
from typing import Any, NoReturn

from typer.core import TyperCommand

from mav_tasks.cli.lazy import beginning_with

LONGEST = 15.0  # s for the help of another program, which a busy machine may need
PASSED_ON = {"allow_extra_args": True, "ignore_unknown_options": True}


class Program(TyperCommand):
    """Runs a module with all arguments; its help names its options and their choices."""

    def __init__(self, name: str, module: str, summary: str) -> None:
        super().__init__(name, help=summary, context_settings=PASSED_ON, add_help_option=False)
        self._module = module

    def invoke(self, ctx: Any) -> NoReturn:
        """Become the program: its process holds no code of the server."""
        sys.stdout.flush()
        os.execv(sys.executable, [sys.executable, "-m", self._module, *ctx.args])

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """Return options, or the choices of the option that was typed before."""
        told = self._help()
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

    def _help(self) -> str:
        command = [sys.executable, "-m", self._module, "--help"]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=LONGEST, check=False
            )
        except (OSError, subprocess.TimeoutExpired):
            return ""
        return done.stdout
