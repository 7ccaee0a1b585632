"""Bytes that nobody can verify are believed by nobody, whoever they say that they are of."""

from pymavlink.dialects.v20 import common

from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from tests.kit.client import (
    heartbeat,
    packed,
    setpoint,
)
from tests.kit.world import World


def test_unverified_bytes_of_our_own_address_are_no_second_server(world: World) -> None:
    world.client.move(2)
    world.until_state(1, S.EXECUTING)
    forged = bytearray(packed(setpoint(1.0), 250, 191))
    forged[-1] ^= 0xFF
    unknown = bytes((0xFD, 1, 0, 0, 0, 250, 191, 0x11, 0x27, 0)) + b"x" + b"\0\0"
    world.from_vehicle_side(bytes(forged))
    world.from_vehicle_side(unknown)
    world.run(0.5)
    assert world.state(1)[0] is S.EXECUTING


def test_unverified_bytes_do_not_move_a_silent_rover_to_another_endpoint(world: World) -> None:
    world.fault(Faults(silent=True))
    world.run(5)
    forged = bytearray(packed(heartbeat(), 1, 1))
    forged[-1] ^= 0xFF
    world.from_vehicle_side(bytes(forged), peer="thief")
    unknown = bytes((0xFD, 1, 0, 0, 0, 1, 1, 0x11, 0x27, 0)) + b"x" + b"\0\0"
    world.from_vehicle_side(unknown, peer="thief")
    position = common.MAVLink_local_position_ned_message(1, 9, 9, 0, 0, 0, 0)
    world.from_vehicle_side(packed(position, 1, 1), peer="thief")
    world.run(0.1)
    stop = world.client.stop()
    world.run(1)
    assert stop.result == common.MAV_RESULT_FAILED
    assert world.mode().name == "HOLD"  # it still hears us
