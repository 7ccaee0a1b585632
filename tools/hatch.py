"""Hatchling's hooks: a wheel has the MAVLink dialect, and a README for its readers.

The README has no link that only works in the repository. A relative link becomes one below `Source`
of `[project.urls]`. While the owner has not said where the source is, the link's text stays and
names the file: GUIDE, changelog and the like are in the wheel.
"""

import re
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

RELATIVE = re.compile(r"\[([^\]]+)\]\((?!\w+:|#)([^)]+)\)")


class WheelHook(BuildHookInterface[Any]):
    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002
        # hatchling loads this file by its path, so its neighbours are not importable yet.
        sys.path.insert(0, str(Path(self.root) / "tools"))
        from generators.dialect import module  # noqa: PLC0415

        path = Path(self.root) / "mav_tasks" / "mavlink" / "_dialect.py"
        made = module()
        if not path.exists() or path.read_text(encoding="utf-8") != made:
            path.write_text(made, encoding="utf-8")


class ReadmeHook(MetadataHookInterface):
    PLUGIN_NAME = "custom"

    def update(self, metadata: dict[str, Any]) -> None:
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        source = metadata.get("urls", {}).get("Source", "")
        metadata["readme"] = {"content-type": "text/markdown", "text": with_links(text, source)}


def with_links(text: str, source: str) -> str:
    """Return the text with relative links below ``source``, or as plain words if that is ""."""
    if not source:
        return RELATIVE.sub(r"\1", text)
    return RELATIVE.sub(rf"[\1]({source.rstrip('/')}/blob/main/\2)", text)
