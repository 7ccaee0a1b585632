"""Packets that check_vehicle counts as missing: gaps are, those that change places are not."""

import pytest
from pymavlink.dialects.v20 import common

from rover_sim.check_vehicle.probe import AUTOPILOT, Probe


class Playback:
    """A wire that gives the packets of a rover with these sequence numbers."""

    def __init__(self, numbers: list[int]) -> None:
        sender = common.MAVLink(None, 1, AUTOPILOT)
        self._packets = []
        for number in numbers:
            sender.seq = number % 256
            self._packets.append(common.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3).pack(sender))

    def now(self) -> float:
        return 0.1 * -len(self._packets)

    def send(self, data: bytes) -> None:
        pass

    def receive(self, within: float) -> bytes:
        return self._packets.pop(0) if self._packets else b""


@pytest.mark.parametrize(
    ("numbers", "missing"),
    [
        ([1, 2, 3, 4], 0),
        ([254, 255, 256, 257], 0),
        ([1, 2, 5, 6], 2),
        ([1, 3, 2, 4, 5], 0),
        ([1, 2, 4, 5, 3, 6], 0),
    ],
)
def test_missing_packets_are_gaps_that_nothing_fills(numbers: list[int], missing: int) -> None:
    probe = Probe(Playback(numbers), system_id=1)
    for _ in numbers:
        probe.pump()
    assert probe.packets[AUTOPILOT] == len(numbers)
    assert probe.lost[AUTOPILOT] == missing
