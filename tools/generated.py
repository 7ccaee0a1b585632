"""Keep generated files current, and generated parts of documents between two marker lines."""

import argparse
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def keep_current(document: str, what: str, tool: str, made: str) -> int:
    """Put the generated text into a document; return the exit code, as ``keep_file_current``."""
    begin, end = f"<!-- {what}: made by tools/{tool} -->\n", f"<!-- end of {what} -->\n"
    text = (ROOT / document).read_text(encoding="utf-8")
    before, has_begin, rest = text.partition(begin)
    _, has_end, after = rest.partition(end)
    if not has_begin or not has_end:
        print(f"{document} lacks the line {begin.strip()} or {end.strip()}")
        return 1
    return keep_file_current(document, what, tool, before + begin + made + end + after)


def keep_file_current(file: str, what: str, tool: str, made: str) -> int:
    """Write the generated text of a file; return the exit code.

    With ``--check`` on the command line, only report whether the file is outdated, and return 1 if
    so.
    """
    parser = argparse.ArgumentParser(description=f"Write the {what} into {file}.")
    parser.add_argument(
        "--check", action="store_true", help="change nothing; exit status 1 if it is outdated"
    )
    is_check = parser.parse_args().check
    path = ROOT / file
    if path.is_file() and path.read_text(encoding="utf-8") == made:
        return 0
    if is_check:
        print(f"{file}: the {what} is outdated; run tools/{tool}")
        return 1
    path.write_text(made, encoding="utf-8")
    return 0
