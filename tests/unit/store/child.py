"""A process that keeps submitting to a store, and says on standard output what became of it.

``python -m tests.unit.store.child PLACE [LIMIT]``: LIMIT is the largest file, bytes, that it may
write from then on, which stands in for a full disk; a line on standard input lifts it. One line for
each outcome: ``kept N``, or the words of the failure.
"""

import resource
import select
import signal
import sys
import time

from mav_tasks.engine.inputs import Committed, HaltNotStored, StoreFailed
from mav_tasks.store import open_store
from tests.unit.store.samples import submitted

UNDER_WAY = 50  # events appended and not yet kept


def main(place: str, limit: int | None) -> None:
    """Run until killed."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # a write beyond the limit fails instead
    store = open_store(place)
    restored = store.load()
    assert restored is not None
    last = kept = max((task.id for task in restored.tasks), default=0)
    before = last
    descriptor = store.fileno()
    assert descriptor is not None
    print("open", flush=True)
    _, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    if limit is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, most))
    while True:
        while last < kept + UNDER_WAY:
            last += 1
            store.append([submitted(last, at=time.monotonic())])
        readable, _, _ = select.select([descriptor, sys.stdin.fileno()], [], [])
        if sys.stdin.fileno() in readable and sys.stdin.readline():
            resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
        for outcome in store.take_outcomes():
            if isinstance(outcome, Committed):
                kept = before + outcome.through
                print(f"kept {kept}", flush=True)
            elif isinstance(outcome, StoreFailed | HaltNotStored):
                print(outcome.text, flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else None)
