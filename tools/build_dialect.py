"""Build `mav_tasks/mavlink/_dialect.py` from `dialects/` with pymavlink's mavgen.

The base is the definition set of the installed pymavlink. `dialects/base_additions.xml` is merged
into a temporary copy of it, without definitions that the base has, because mavgen refuses a message
that is defined twice. The output depends only on the definitions and the pymavlink version: no
date, no path. The build hook and the gate both call this file.
"""

import argparse
import contextlib
import hashlib
import importlib.metadata
import importlib.util
import io
import os
import re
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parent.parent
DIALECT = Path("dialects/mav_tasks.xml")
ADDITIONS = Path("dialects/base_additions.xml")
OUTPUT = Path("mav_tasks/mavlink/_dialect.py")
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
    """The dialect cannot be built; the message is one line, or mavgen's own output."""


def build_dialect(root: Path = ROOT) -> bool:
    """Update the generated module. Return True if it was written."""
    header = _header(root, _base_files())
    output = root / OUTPUT
    if output.is_file() and _first_line(output) == header:
        return False
    _write_atomically(output, _generate(root, header))
    return True


def check_dialect(root: Path = ROOT) -> str | None:
    """Return what is wrong with the generated module, or None. It also detects manual edits."""
    output = root / OUTPUT
    if not output.is_file():
        return f"{OUTPUT} is missing; run tools/build_dialect.py"
    if output.read_bytes() != _generate(root, _header(root, _base_files())):
        return f"{OUTPUT} is not what {DIALECT} generates; run tools/build_dialect.py --force"
    return None


def _base_files() -> list[Path]:
    """Return the base definitions of pymavlink, with all included files."""
    spec = importlib.util.find_spec("pymavlink")
    if spec is None or not spec.submodule_search_locations:
        raise DialectError("pymavlink is not installed: pip install pymavlink")
    folder = Path(spec.submodule_search_locations[0]) / "dialects" / "v20"
    files: list[Path] = []
    waiting = [BASE]
    while waiting:
        file = folder / waiting.pop(0)
        if file in files:
            continue
        if not file.is_file():
            raise DialectError(f"the installed pymavlink ships no {file.name}")
        files.append(file)
        waiting += [(e.text or "").strip() for e in ElementTree.parse(file).iter("include")]
    return files


def _header(root: Path, base: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for file in (Path(__file__), root / DIALECT, root / ADDITIONS, *base):
        content = file.read_bytes()
        digest.update(f"{file.name} {len(content)}\n".encode() + content)
    version = importlib.metadata.version("pymavlink")
    return f"# tools/build_dialect.py with pymavlink {version} made this of {digest.hexdigest()}\n"


def _generate(root: Path, header: str) -> bytes:
    with tempfile.TemporaryDirectory(prefix="mav-tasks-dialect-") as name:
        folder = Path(name)
        _write_definitions(root, folder)
        # mavgen takes the dialect's name from the output file's.
        source, output = folder / DIALECT.name, folder / "mav_tasks.py"
        _run_mavgen(source, output)
        return (header + _made_light(output.read_text("utf-8"))).encode()


def _write_definitions(root: Path, folder: Path) -> None:
    base = [(file.name, ElementTree.parse(file).getroot()) for file in _base_files()]
    _merge([tree for _, tree in base], ElementTree.parse(root / ADDITIONS).getroot())
    for name, tree in base:
        ElementTree.ElementTree(tree).write(folder / name, encoding="utf-8", xml_declaration=True)
    (folder / DIALECT.name).write_bytes((root / DIALECT).read_bytes())


def _merge(base: list[ElementTree.Element], additions: ElementTree.Element) -> None:
    """Add definitions that no file of the base has to the first file of the base."""
    for enum in additions.iter("enum"):
        known = _named(base, "enum", enum.attrib["name"])
        if not known:
            _section(base[0], "enums").append(enum)
            continue
        taken = {(e.get("name"), e.get("value")) for same in known for e in same.iter("entry")}
        names, values = {name for name, _ in taken}, {value for _, value in taken}
        for entry in enum.findall("entry"):
            if entry.get("name") not in names and entry.get("value") not in values:
                known[0].append(entry)
    for message in additions.iter("message"):
        known = _named(base, "message", message.attrib["name"])
        if known:
            _extend(known[0], message)
        elif message.find("description") is None:
            raise DialectError(f"pymavlink's {BASE} has no {message.get('name')} to extend")
        else:
            _section(base[0], "messages").append(message)


def _extend(known: ElementTree.Element, message: ElementTree.Element) -> None:
    """Append missing extension fields; base fields determine CRC_EXTRA and stay."""
    children = list(message)
    start = next(
        (i for i, child in enumerate(children) if child.tag == "extensions"), len(children)
    )
    names = {field.get("name") for field in known.iter("field")}
    for field in children[start + 1 :]:
        if field.get("name") in names:
            continue
        if known.find("extensions") is None:
            ElementTree.SubElement(known, "extensions")
        known.append(field)


def _named(base: list[ElementTree.Element], tag: str, name: str) -> list[ElementTree.Element]:
    return [element for tree in base for element in tree.iter(tag) if element.get("name") == name]


def _section(tree: ElementTree.Element, tag: str) -> ElementTree.Element:
    section = tree.find(tag)
    return ElementTree.SubElement(tree, tag) if section is None else section


def _run_mavgen(source: Path, output: Path) -> None:
    try:
        from pymavlink.generator import mavgen, mavparse  # noqa: PLC0415
    except ImportError as error:
        raise DialectError(f"mavgen cannot be used: {error}") from error
    options = mavgen.Opts(
        str(output), mavparse.PROTOCOL_2_0, language="Python3", validate=True, strict_units=False
    )
    said = io.StringIO()  # mavgen reports each file; useful only if it fails
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            done = mavgen.mavgen(options, [str(source)])
    except (Exception, SystemExit) as error:
        raise DialectError(f"mavgen failed: {error}\n{said.getvalue()}") from error
    if not done or not output.is_file():
        raise DialectError(f"mavgen failed:\n{said.getvalue()}")


def _made_light(module: str) -> str:
    """Reduce each message constructor to setting its fields.

    mavgen's constructors also set values that are the same for each message type, which took two
    thirds of the time of creating one. They are set once per type instead.
    """
    light, count = _COMMON.subn("", module)
    if count < MESSAGES:
        raise DialectError("mavgen writes other constructors than this file knows")
    return light + _OF_KIND


def _first_line(file: Path) -> str:
    with file.open(encoding="utf-8") as stream:
        return stream.readline()


def _write_atomically(file: Path, content: bytes) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_name(f"{file.name}.{os.getpid()}.part")
    try:
        part.write_bytes(content)
        part.replace(file)
    finally:
        part.unlink(missing_ok=True)


def main() -> int:
    parser = argparse.ArgumentParser(description="Build the Python module of the MAVLink dialect.")
    parser.add_argument(
        "--check", action="store_true", help="write nothing; fail if it is not current"
    )
    parser.add_argument("--force", action="store_true", help="write even if it looks current")
    arguments = parser.parse_args()
    try:
        if arguments.check:
            problem = check_dialect()
            if problem:
                raise DialectError(problem)
            print(f"{OUTPUT} is current")
            return 0
        if arguments.force:
            (ROOT / OUTPUT).unlink(missing_ok=True)
        print(f"{OUTPUT} {'written' if build_dialect() else 'is current'}")
    except DialectError as error:
        print(f"build_dialect: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
