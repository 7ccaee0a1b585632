"""A process with a small file system of its own, which it fills; then it stops a rover.

``unshare --user --map-root-user --mount python -m tests.unit.store.full_disk``: says on standard
output what became of a submission and how the queue stands in the next life of the store.
"""

import os
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

from mav_tasks.engine.inputs import HaltsKept, StoreFailed
from mav_tasks.store import open_store
from mav_tasks.tasks.events import QueuePaused
from mav_tasks.tasks.lifecycle import TaskReason
from tests.unit.store.samples import loaded, next_outcomes, opened, submitted, wait_for_failure

NO_NAMESPACE = 77
ROOM = "size=2m"


def main() -> None:
    """Mount, fill, stop, die, look."""
    with tempfile.TemporaryDirectory() as place:
        mount = ["mount", "-t", "tmpfs", "-o", ROOM, "none", place]
        if subprocess.run(mount, check=False).returncode:
            sys.exit(NO_NAMESPACE)
        path = Path(place) / "tasks.sqlite3"
        if os.fork() == 0:
            stop_on_full_disk(path)
        os.wait()
        (path.parent / "filler").unlink()
        with opened(path) as store:
            restored = loaded(store)
            print(restored.paused[1].name)
        subprocess.run(["umount", place], check=True)


def stop_on_full_disk(path: Path) -> None:
    """Stop a rover when nothing can be written, and die when the record has had time for it."""
    store = open_store(str(path))
    fill(path.parent / "filler")
    store.append([submitted(number) for number in range(1, 1000)])  # more than the log has room for
    failure: StoreFailed = wait_for_failure(store)
    print("not kept" if "full" in failure.text else failure.text, flush=True)
    store.append([QueuePaused(1, TaskReason.STOPPED, "client", 100.0)])
    while not any(isinstance(outcome, HaltsKept) for outcome in next_outcomes(store)):
        pass
    os._exit(0)


def fill(filler: Path) -> None:
    """Write until there is no room for a byte more."""
    with filler.open("wb", buffering=0) as file:
        for size in (65_536, 4096, 1):
            with suppress(OSError):
                while True:
                    file.write(bytes(size))


if __name__ == "__main__":
    main()
