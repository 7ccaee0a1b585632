"""The Python module of the MAVLink dialect, made from `dialects/` with pymavlink's mavgen.

The base is the definition set of the installed pymavlink. `dialects/base_additions.xml` is merged
into a temporary copy of it, without definitions that the base has, because mavgen refuses a message
that is defined twice. The module depends only on the definitions and the pymavlink version: no
date, no path. `tools/generate` writes it, and so does the build of a wheel.
"""

import contextlib
import io
import re
import tempfile
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pymavlink
from pymavlink.generator import mavgen, mavparse

DIALECTS = Path(__file__).resolve().parents[2] / "dialects"
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


class DialectError(Exception):
    """The dialect cannot be made; the message is one line, or mavgen's own output."""


def module() -> str:
    """Return the text of the module."""
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
    """Add definitions that no file of the base has to the first file of the base."""
    for enum in additions.iter("enum"):
        known = _named(base, enum)
        if not known:
            _section(base[0], "enums").append(enum)
            continue
        taken = [entry.get(key) for same in known for entry in same for key in ("name", "value")]
        for entry in enum.findall("entry"):
            if entry.get("name") not in taken and entry.get("value") not in taken:
                known[0].append(entry)
    for message in additions.iter("message"):
        known = _named(base, message)
        if known:
            _extend(known[0], message)
        elif message.find("description") is None:
            raise DialectError(f"pymavlink's {BASE} has no {message.get('name')} to extend")
        else:
            _section(base[0], "messages").append(message)


def _named(base: list[Element], like: Element) -> list[Element]:
    name = like.get("name")
    return [each for tree in base for each in tree.iter(like.tag) if each.get("name") == name]


def _section(tree: Element, tag: str) -> Element:
    section = tree.find(tag)
    return ElementTree.SubElement(tree, tag) if section is None else section


def _extend(known: Element, message: Element) -> None:
    """Append missing extension fields; base fields determine CRC_EXTRA and stay."""
    names = {field.get("name") for field in known.iter("field")}
    is_extension = False
    for child in message:
        if is_extension and child.get("name") not in names:
            _section(known, "extensions")
            known.append(child)
        is_extension |= child.tag == "extensions"


def _generated(source: Path) -> str:
    output = source.with_suffix(".py")  # mavgen takes the dialect's name from it
    options = mavgen.Opts(
        str(output), mavparse.PROTOCOL_2_0, language="Python3", validate=True, strict_units=False
    )
    said = io.StringIO()  # mavgen reports each file; useful only if it fails
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        done = mavgen.mavgen(options, [str(source)])
    if not done:
        raise DialectError(f"mavgen failed:\n{said.getvalue()}")
    return output.read_text("utf-8")


def _light(made: str) -> str:
    """Reduce each message constructor to setting its fields.

    mavgen's constructors also set values that are the same for each message type, which took two
    thirds of the time of creating one. They are set once per type instead.
    """
    light, count = _COMMON.subn("", made)
    if count < MESSAGES:
        raise DialectError("mavgen writes other constructors than this file knows")
    return light + _OF_KIND
