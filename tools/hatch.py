"""What a wheel has that git has not: the MAVLink dialect, and a README for its readers.

The module of the dialect is made from `dialects/` with pymavlink's mavgen. The base is the
definition set of the installed pymavlink. `dialects/base_additions.xml` is merged into a temporary
copy of it, without definitions that the base has, because mavgen refuses a message that is defined
twice. The module depends only on the definitions and the pymavlink version: no date, no path.
`tools/generate` writes it, too.

The README has no link that only works in the repository. A relative link becomes one below `Source`
of `[project.urls]`. While the owner has not said where the source is, the link's text stays and
names the file: GUIDE, changelog and the like are in the wheel.
"""

import contextlib
import io
import re
import tempfile
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pymavlink
from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface
from pymavlink.generator import mavgen, mavparse

ROOT = Path(__file__).resolve().parent.parent
DIALECTS = ROOT / "dialects"
DEFINITIONS = Path(pymavlink.__file__).parent / "dialects" / "v20"
BASE = "common.xml"
MESSAGES = 200  # fewer than the base has
#: the beginning of each message constructor
_COMMON = re.compile(
    r"        MAVLink_message\.__init__\(self, (\w+)\.id, \1\.msgname\)\n"
    r"        self\._fieldnames = \1\.fieldnames\n"
    r"        self\._instance_field = \1\.instance_field\n"
    r"        self\._instance_offset = \1\.instance_offset\n"
)
_OF_KIND = """

for _kind in mavlink_map.values():
    _every = MAVLink_message(_kind.id, _kind.msgname)
    for _name, _value in vars(_every).items():
        setattr(_kind, _name, _value)
    _kind._fieldnames = _kind.fieldnames
    _kind._instance_field = _kind.instance_field
    _kind._instance_offset = _kind.instance_offset
"""
RELATIVE = re.compile(r"\[([^\]]+)\]\((?!\w+:|#)([^)]+)\)")  # links


class WheelHook(BuildHookInterface[Any]):
    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002
        path = ROOT / "mav_tasks" / "mavlink" / "_dialect.py"
        made = dialect()
        if not path.exists() or path.read_text(encoding="utf-8") != made:
            path.write_text(made, encoding="utf-8")


class ReadmeHook(MetadataHookInterface):
    PLUGIN_NAME = "custom"

    def update(self, metadata: dict[str, Any]) -> None:
        text = (ROOT / "README.md").read_text(encoding="utf-8")
        source = metadata.get("urls", {}).get("Source", "")
        metadata["readme"] = {"content-type": "text/markdown", "text": with_links(text, source)}


def with_links(text: str, source: str) -> str:
    """Return the text with relative links below ``source``, or as plain words if that is ""."""
    if not source:
        return RELATIVE.sub(r"\1", text)
    return RELATIVE.sub(rf"[\1]({source.rstrip('/')}/blob/main/\2)", text)


def dialect() -> str:
    """Return the Python module of the dialect."""
    base = {name: ElementTree.parse(DEFINITIONS / name).getroot() for name in _included(BASE)}
    _merge([*base.values()], ElementTree.parse(DIALECTS / "base_additions.xml").getroot())
    with tempfile.TemporaryDirectory(prefix="mav-tasks-dialect-") as folder:
        for name, tree in base.items():
            ElementTree.ElementTree(tree).write(Path(folder) / name, encoding="utf-8")
        source = Path(folder) / "mav_tasks.xml"
        source.write_bytes((DIALECTS / source.name).read_bytes())
        made = _generated(source)
    return f"# Made by tools/generate with pymavlink {version('pymavlink')}.\n{_light(made)}"


def _included(name: str) -> Iterator[str]:
    """Return the names of a definition file and of those that it includes."""
    yield name
    for element in ElementTree.parse(DEFINITIONS / name).iter("include"):
        yield from _included((element.text or "").strip())


def _merge(base: list[Element], additions: Element) -> None:
    """Add enums and messages, and entries and extension fields of known ones, that no file has.

    Base fields determine CRC_EXTRA, and stay.
    """
    for ours in [*additions.iter("enum"), *additions.iter("message")]:
        known = [each for tree in base for each in tree.iter(ours.tag) if _is_like(each, ours)]
        if not known:
            _part(base[0], f"{ours.tag}s").append(ours)
            continue
        taken = [child for same in known for child in same]
        missing = [
            child
            for child in ours
            if child.get("name") and not any(_is_like(child, other) for other in taken)
        ]
        if missing and ours.find("extensions") is not None:
            _part(known[0], "extensions")
        known[0].extend(missing)


def _is_like(one: Element, other: Element) -> bool:
    """Return whether both have the same name, or the same value."""
    return any(one.get(key, "") == other.get(key) for key in ("name", "value"))


def _part(tree: Element, tag: str) -> Element:
    part = tree.find(tag)
    return ElementTree.SubElement(tree, tag) if part is None else part


def _generated(source: Path) -> str:
    output = source.with_suffix(".py")  # mavgen takes the dialect's name from it
    options = mavgen.Opts(
        str(output), mavparse.PROTOCOL_2_0, language="Python3", validate=True, strict_units=False
    )
    said = io.StringIO()  # mavgen reports each file; useful only if it fails
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        done = mavgen.mavgen(options, [str(source)])
    if not done:
        raise RuntimeError(f"mavgen failed:\n{said.getvalue()}")
    return output.read_text("utf-8")


def _light(made: str) -> str:
    """Reduce each message constructor to setting its fields.

    mavgen's constructors also set values that are the same for each message type, which took two
    thirds of the time of creating one. They are set once per type instead.
    """
    light, count = _COMMON.subn("", made)
    if count < MESSAGES:
        raise RuntimeError("mavgen writes other constructors than this file knows")
    return light + _OF_KIND
