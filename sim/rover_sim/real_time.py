"""Vehicles in real time on one UDP socket: the simulator's only clock and its only loop."""

import selectors
import socket
import sys
import time
from typing import Any, TextIO, cast

from rover_sim.fault_player import FaultPlayer
from rover_sim.vehicle import Vehicle

MAX_DATAGRAM = 65535
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
    server: socket.socket,
    stop: socket.socket,
    vehicles: list[Vehicle],
    clock: Clock,
    truth: TextIO | None,
    faults: FaultPlayer,
) -> None:
    """Run the vehicles on the (non-blocking) server socket until ``stop`` is readable."""
    selector = selectors.DefaultSelector()
    selector.register(server, selectors.EVENT_READ)
    selector.register(stop, selectors.EVENT_READ)
    truth_due = clock.now()
    with selector:
        while True:
            deadline = min(vehicle.next_deadline() for vehicle in vehicles)
            ready = selector.select(max(0.0, (deadline - clock.now()) / clock.speed))
            if any(key.fileobj is stop for key, _ in ready):
                return
            if ready:
                _read(server, vehicles, clock)
            now = clock.now()
            for line in faults.play(now - clock.start, now=now):
                sys.stdout.write(f"rover_sim: {line}\n")
                sys.stdout.flush()
            for vehicle in vehicles:
                vehicle.handle_deadline(now=now)
                _send(server, vehicle)
            if truth is not None and now >= truth_due:
                _write_truth(truth, vehicles, now - clock.start)
                truth_due = max(truth_due + TRUTH_INTERVAL, now)


def _read(server: socket.socket, vehicles: list[Vehicle], clock: Clock) -> None:
    for _ in range(DATAGRAMS_PER_TURN):
        try:
            data, peer = server.recvfrom(MAX_DATAGRAM)
        except BlockingIOError:
            return
        except OSError:  # an earlier datagram met a closed port: that peer will time out
            continue
        now = clock.now()
        for vehicle in vehicles:
            vehicle.receive(data, peer, now=now)


def _send(server: socket.socket, vehicle: Vehicle) -> None:
    for peer, packet in vehicle.take_packets():
        try:
            server.sendto(packet, cast(tuple[Any, ...], peer))  # as recvfrom returned it
        except OSError:  # full buffer or unreachable peer: a datagram link may lose packets
            continue


def _write_truth(truth: TextIO, vehicles: list[Vehicle], elapsed: float) -> None:
    for vehicle in vehicles:
        s = vehicle.truth
        truth.write(
            f"{elapsed:.3f},{vehicle.autopilot.address.system_id},{s.north:.4f},{s.east:.4f},"
            f"{s.yaw:.5f},{s.forward_speed:.4f},{s.yaw_rate:.4f}\n"
        )
    truth.flush()
