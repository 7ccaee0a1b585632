"""``python -m tests.kit.crashing POINT serve …``: mav-tasks, killed at one point of its writing.

POINT is ``before:EVENT`` or ``after:EVENT``: before the transaction with the first such event, or
after its commit but before the report. EVENT is an event's class name; for a TaskChanged with its
new state, as in ``TaskChanged.EXECUTING``.
"""

import os
import signal
import sys
from collections.abc import Sequence

from mav_tasks.cli.app import main
from mav_tasks.store.batch import Batch
from mav_tasks.store.database import Database
from mav_tasks.store.writer import Writer
from mav_tasks.tasks.events import Event, TaskChanged


def name_of(event: Event) -> str:
    """Return an event's name in a point."""
    name = type(event).__name__
    return f"{name}.{event.new.name}" if isinstance(event, TaskChanged) else name


def die_at(point: str) -> None:
    """Patch the writer to kill the process at a point."""
    when, _, wanted = point.partition(":")
    write_events, write_batch = Writer._write, Database.write
    is_here = False

    def of_writer(self: Writer, events: Sequence[Event]) -> bool:
        nonlocal is_here
        is_here = any(name_of(event) == wanted for event in events)
        return write_events(self, events)

    def of_database(self: Database, batch: Batch, *, utc: float) -> None:
        if is_here and when == "before":
            os.kill(os.getpid(), signal.SIGKILL)
        write_batch(self, batch, utc=utc)
        if is_here and when == "after":
            os.kill(os.getpid(), signal.SIGKILL)

    Writer._write = of_writer  # type: ignore[method-assign]
    Database.write = of_database  # type: ignore[method-assign]


if __name__ == "__main__":
    die_at(sys.argv[1])
    del sys.argv[1]
    main()
