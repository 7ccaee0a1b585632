"""Hatchling's metadata hook: the README of a wheel has no link that only works in the repository.

A relative link becomes one below `Source` of `[project.urls]`. While the owner has not said where
the source is, the link's text stays and names the file: GUIDE, changelog and the like are in the
wheel.
"""

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

RELATIVE = re.compile(r"\[([^\]]+)\]\((?!\w+:|#)([^)]+)\)")


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
