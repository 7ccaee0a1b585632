"""Runs ``mav-tasks`` and records the files that it opens: ``python audited.py OUT command ...``.

It is a separate process, because an audit hook is permanent. SQLite opens its files itself, so only
the name in sqlite3.connect shows.
"""

import json
import os
import sys
from pathlib import Path

WATCHED = ("open", "os.", "shutil.", "glob.", "pathlib.", "sqlite3.connect", "subprocess.")
UNINTERESTING = ("os.putenv", "os.unsetenv", "os.fwalk")


def main() -> None:
    out, sys.argv = Path(sys.argv[1]), ["mav-tasks", *sys.argv[2:]]
    seen: list[tuple[str, list[object]]] = []
    sys.dont_write_bytecode = True  # Python's bytecode cache is not of interest
    fd = os.open(out, os.O_WRONLY | os.O_CREAT, 0o600)

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        if event.startswith(WATCHED) and event not in UNINTERESTING:
            plain: list[object] = [
                each if isinstance(each, int) else str(each) for each in arguments
            ]
            seen.append((event, plain))

    sys.addaudithook(hook)
    from mav_tasks.cli.app import main as run

    try:
        run(sys.argv[1:])  # with arguments it ends as a function does, and not the process at once
    finally:
        os.write(fd, json.dumps(seen).encode())


if __name__ == "__main__":
    main()
