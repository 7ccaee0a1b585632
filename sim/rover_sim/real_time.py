"""Vehicles in real time on one UDP socket: the simulator's only clock and its only loop."""

import sys
import time
from select import select
from typing import NoReturn, TextIO

from mav_tasks.links.base import Link
from rover_sim.fault_player import FaultPlayer
from rover_sim.vehicle import Vehicle, exchange

DATAGRAMS_PER_TURN = 64  # then the rovers get their turn
TRUTH_INTERVAL = 0.1  # s


class Clock:
    """Simulated time: the monotonic clock, scaled by ``speed`` from its start."""

    def __init__(self, speed: float) -> None:
        self.speed = speed
        self.start = time.monotonic()

    def now(self) -> float:
        """Return simulated seconds; at real speed they equal the monotonic clock."""
        return self.start + (time.monotonic() - self.start) * self.speed


def drive(
    link: Link,
    vehicles: list[Vehicle],
    clock: Clock,
    truth: TextIO | None,
    faults: FaultPlayer,
) -> NoReturn:
    """Run the vehicles on the link, until an exception ends it."""
    truth_due = clock.now()
    while True:
        deadline = min(vehicle.next_deadline() for vehicle in vehicles)
        ready, _, _ = select([link], [], [], max(0.0, (deadline - clock.now()) / clock.speed))
        now = clock.now()
        for line in faults.play(now - clock.start, now=now):
            sys.stdout.write(f"rover_sim: {line}\n")
            sys.stdout.flush()
        exchange(link, vehicles, now, DATAGRAMS_PER_TURN if ready else 0)
        if truth is not None and now >= truth_due:
            _write_truth(truth, vehicles, now - clock.start)
            truth_due = max(truth_due + TRUTH_INTERVAL, now)


def _write_truth(truth: TextIO, vehicles: list[Vehicle], elapsed: float) -> None:
    for vehicle in vehicles:
        s = vehicle.truth
        truth.write(
            f"{elapsed:.3f},{vehicle.autopilot.address.system_id},{s.north:.4f},{s.east:.4f},"
            f"{s.yaw:.5f},{s.forward_speed:.4f},{s.yaw_rate:.4f}\n"
        )
    truth.flush()
