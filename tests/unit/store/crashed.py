"""A server whose database takes nothing, and which is gone as soon as its halts are kept.

``crash`` runs it as a process: what is durable then is in the record of halts alone.
"""

import os
import pickle
import subprocess
import sys
from pathlib import Path

from mav_tasks.engine.inputs import HaltsKept
from mav_tasks.tasks.events import Event, TaskSubmitted
from tests.kit.databases import locked
from tests.unit.store.samples import PATIENCE, next_outcomes, opened

ROOT = Path(__file__).resolve().parents[3]


def crash(place: str | Path, *events: Event) -> None:
    """Let a server take halts, of which the database gets none, and vanish."""
    subprocess.run(
        [sys.executable, "-m", "tests.unit.store.crashed", str(place)],
        cwd=ROOT,
        input=pickle.dumps(events),
        timeout=PATIENCE,
        check=True,
    )


def main(place: str) -> None:
    """Crash with the events on standard input."""
    with opened(place) as store, locked(place):
        events = pickle.load(sys.stdin.buffer)
        for number, event in enumerate(events, 1):
            store.append([event])
            while not isinstance(event, TaskSubmitted):
                if HaltsKept(number) in next_outcomes(store):
                    break
        os._exit(0)


if __name__ == "__main__":
    main(sys.argv[1])
