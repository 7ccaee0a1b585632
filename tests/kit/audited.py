"""Runs ``mav-tasks`` and writes down what files it opens: ``python audited.py OUT command ...``.

A process of its own, because an audit hook stays for good. SQLite opens its files itself: of those
only the name shows that the store gives it.
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
    sys.dont_write_bytecode = True  # what the interpreter keeps for itself is not ours
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
        run()
    finally:
        os.write(fd, json.dumps(seen).encode())


if __name__ == "__main__":
    main()
