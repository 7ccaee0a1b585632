"""Hatchling's build hook: puts the generated dialect, and if asked the compiled core, into a wheel.

`build_dialect` and `compile_core` do the work, so that set-up, gate and build have the same result.
MAV_TASKS_COMPILE=1 asks for the compiled core; an editable install never has it, because changed
sources would not run.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class WheelHook(BuildHookInterface[Any]):
    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        # A later mypy may compile otherwise: its version is the one that was tried.
        return ["mypy==2.4.1", "setuptools>=75,<81"] if _is_compiled() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        # hatchling loads this file by its path, so its neighbours are not importable yet.
        sys.path.insert(0, str(Path(self.root) / "tools"))
        from build_dialect import build_dialect  # noqa: PLC0415

        if build_dialect(Path(self.root)):
            self.app.display_info("generated the MAVLink dialect")
        if _is_compiled() and version != "editable":
            self._folder = tempfile.TemporaryDirectory()  # as long as this hook: until all is built
            compiler = str(Path(self.root) / "tools" / "compile_core.py")
            made = subprocess.run(
                [sys.executable, compiler, self._folder.name],
                stdout=subprocess.PIPE,
                text=True,
                check=True,
            )
            build_data["force_include"] |= {
                str(Path(self._folder.name) / name): name for name in made.stdout.splitlines()
            }
            build_data["pure_python"], build_data["infer_tag"] = False, True


def _is_compiled() -> bool:
    return os.environ.get("MAV_TASKS_COMPILE", "") not in ("", "0")
