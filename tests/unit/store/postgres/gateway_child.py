"""A process that is a gateway, keeps submitting, and says on standard output what is kept.

``python -m tests.unit.store.postgres.gateway_child URL NAME``: one line ``kept N`` for each report.
"""

import select
import sys

from mav_tasks.engine.inputs import Committed
from tests.unit.store.postgres.gateways import Gateway, of_vehicle

UNDER_WAY = 50  # events appended and not yet kept


def main(url: str, name: str) -> None:
    """Run until killed."""
    print("begun", flush=True)
    gateway = Gateway(url, name)
    last = kept = 0
    while True:
        while last < kept + UNDER_WAY:
            last += 1
            gateway.store.append([of_vehicle(last, 1)])
        fd = gateway.store.fileno()
        assert fd is not None
        select.select([fd], [], [])
        for outcome in gateway.store.take_outcomes():
            if isinstance(outcome, Committed):
                kept = outcome.through
                print(f"kept {kept}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
