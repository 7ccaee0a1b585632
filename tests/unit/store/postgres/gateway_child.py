"""A process that is a gateway, keeps submitting, and says on standard output what is kept.

``python -m tests.unit.store.postgres.gateway_child URL NAME [POINT]``: one line ``kept N`` for each
report. At POINT it stops itself (SIGSTOP): ``write`` in a batch whose end was not sent yet,
``trim`` between two statements that delete expired rows.
"""

import select
import signal
import sys
import threading
from typing import Any

from mav_tasks.store import Kept
from mav_tasks.store.postgres.fleet_database import FleetDatabase
from mav_tasks.store.retention import Trimmer
from tests.unit.store.postgres.gateways import Gateway, of_vehicle

UNDER_WAY = 50  # events appended and not yet kept
MANY = 1_000  # events of a batch that is sent in parts


def stop_in(kind: type, method: str) -> None:
    """Let this process stop itself after each call of a method."""
    original = getattr(kind, method)

    def stopping(*arguments: Any, **more: Any) -> Any:
        result = original(*arguments, **more)
        # to this thread: another one would take it later, and this one would go on until then
        signal.pthread_kill(threading.get_ident(), signal.SIGSTOP)
        return result

    setattr(kind, method, stopping)


def main(url: str, name: str, point: str) -> None:
    """Run until killed."""
    if point == "trim":
        stop_in(Trimmer, "_delete_tasks")
    print("begun", flush=True)
    gateway = Gateway(url, name)
    if point == "write":
        stop_in(FleetDatabase, "_insert")
        gateway.store.append([of_vehicle(number, 1) for number in range(1, MANY + 1)])
    last = kept = 0
    while True:
        while not point and last < kept + UNDER_WAY:
            last += 1
            gateway.store.append([of_vehicle(last, 1)])
        fd = gateway.store.fileno()
        assert fd is not None
        select.select([fd], [], [])
        for outcome in gateway.store.take_outcomes():
            if isinstance(outcome, Kept):
                kept = outcome.through
                print(f"kept {kept}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3] if len(sys.argv) > 3 else "")
