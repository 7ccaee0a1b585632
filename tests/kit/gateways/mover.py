"""``python -m tests.kit.gateways.mover URL NAME FILE VEHICLE…``: a gateway that moves vehicles.

It believes to hear the vehicles, and 20 times a second appends a line to the file for each one that
it may move: two times of CLOCK_MONOTONIC, just before it asked and just after, its epoch, its name,
its process id and the vehicle. The lines ``deaf`` and ``hears`` on its standard input cut and mend
its pings. It prints what changes.
"""

import os
import select
import sys
import time
from contextlib import closing

from mav_tasks.errors import StoreError
from mav_tasks.fleet_io import keeper
from mav_tasks.fleet_io.peers import Peers, Seen
from mav_tasks.store.postgres.address import parse

PERIOD = 0.05  # s
HOST = "127.0.0.1"


class CutPeers(Peers):
    """Pings over a net that may be cut."""

    is_cut = False

    def ask(self, now: float) -> None:
        if not self.is_cut:
            super().ask(now)

    def receive(self, name: str, epoch: int, *, now: float) -> list[Seen]:
        """Read all the same: what came while the net was cut must not be read later."""
        if not self.is_cut:
            return super().receive(name, epoch, now=now)
        super().receive("", 0, now=now)  # nobody's name: it answers nothing
        return []


def main(url: str, name: str, path: str, vehicles: frozenset[int]) -> None:
    """Run until standard input ends."""
    vars(keeper)["Peers"] = CutPeers
    try:
        it = keeper.Keeper(parse(url), name, host=HOST)
    except StoreError as error:
        sys.exit(str(error))
    file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    with closing(it):
        it.hear(vehicles)
        has_news = it.fileno()
        assert has_news is not None
        print("begun", flush=True)
        tick = time.monotonic()
        while True:
            for vehicle in sorted(vehicles):
                move(it, file, f"{name} {os.getpid()} {vehicle}\n", vehicle)
            tick = max(tick + PERIOD, time.monotonic())
            while (left := tick - time.monotonic()) > 0:
                readable, _, _ = select.select([0, has_news], [], [], left)
                if has_news in readable:
                    for news in it.take():
                        print(f"{time.monotonic():.3f} {news}", flush=True)
                if 0 in readable:
                    command = os.read(0, 100).decode()
                    if not command:
                        return
                    CutPeers.is_cut = command.endswith("deaf\n")


def move(it: keeper.Keeper, file: int, words: str, vehicle: int) -> None:
    """Append a line if the vehicle may be moved."""
    before = time.monotonic()
    if it.may_move(vehicle):
        after = time.monotonic()
        os.write(file, f"{before!r} {after!r} {it.epoch} {words}".encode())


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3], frozenset(map(int, sys.argv[4:])))
