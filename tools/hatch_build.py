"""Hatchling's build hook: puts the generated dialect into a wheel.

`build_dialect` does the work, so that set-up, gate and build have the same result.
"""

import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class WheelHook(BuildHookInterface[Any]):
    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002
        # hatchling loads this file by its path, so its neighbours are not importable yet.
        sys.path.insert(0, str(Path(self.root) / "tools"))
        from build_dialect import build_dialect  # noqa: PLC0415

        if build_dialect(Path(self.root)):
            self.app.display_info("generated the MAVLink dialect")
