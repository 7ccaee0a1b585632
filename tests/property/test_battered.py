"""Packets of every kind, most of them broken, as anybody may send them."""

from math import isfinite
from random import Random
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.shell.in_memory import CLIENT_LINK, VEHICLE_LINK
from tests.kit.bounds import too_large
from tests.kit.gateways.engines import SETPOINTS, moves
from tests.kit.packets.mutants import Mutants
from tests.kit.world import World

SEED = 20261121
PACKETS = 5_000
BURST, STEP = 50, 0.02  # packets at one time, and s between two bursts
ENDS = ((CLIENT_LINK, "client"), (VEHICLE_LINK, "rover1"))
STRANGERS = 1_000


@pytest.mark.slow
def test_whatever_comes_from_anywhere_nothing_raises_nor_leads_to_a_wrong_setpoint() -> None:
    world, random = World().ready(), Random(SEED)
    mutants, decoder = Mutants(random), common.MAVLink(None)
    passed_on: set[int] = set()

    def look(source: str, _target: str, data: bytes) -> bool:
        if source == VEHICLE_LINK:
            passed_on.add(data[7])
        if source == VEHICLE_LINK and data[7] in SETPOINTS:
            message = decoder.decode(bytearray(data))
            assert all(map(isfinite, (message.vx, message.vy, message.vz, message.yaw_rate)))
            assert not moves(data) or any(each.armed for each in seen().vehicles)
        return False

    def seen() -> Any:
        return world.server.engine.snapshot(now=world.now)

    world.watched.loses = look
    for number in range(PACKETS):
        link, peer = random.choice(ENDS)
        if random.random() < 0.2:
            peer = f"stranger {random.randrange(STRANGERS)}"
        world.net.send(peer, link, mutants.any().data)
        if number % BURST == 0:
            world.run(STEP)
    assert list(too_large(world.server.engine)) == []
    assert len(passed_on) > 20  # kinds of messages: much is believed
