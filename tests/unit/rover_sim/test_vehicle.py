"""A vehicle on its link: any bytes, several peers, and time that is the caller's."""

import random
from itertools import pairwise

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.packet import split_datagram
from rover_sim.body import Pose
from rover_sim.kinematic import KinematicBody
from rover_sim.personas import Mode
from rover_sim.realism import EXACT
from rover_sim.vehicle import Vehicle, make_vehicle
from tests.unit.rover_sim.rig import heartbeat


def fresh() -> Vehicle:
    body = KinematicBody(start=Pose(), slip=0.0, seed=None)
    return make_vehicle(body, system_id=1, now=0.0, realism=EXACT)


def run(vehicle: Vehicle, until: float) -> set[object]:
    """Let it live; give the peers that it talked to."""
    while vehicle.next_deadline() < until:
        vehicle.handle_deadline(now=vehicle.next_deadline())
    return {peer for peer, _ in vehicle.take_packets()}


def test_it_talks_to_everybody_heard_until_they_fall_silent() -> None:
    vehicle, encoder = fresh(), Encoder(Address(255, 190))
    vehicle.receive(encoder.encode(heartbeat()), "first", now=0.0)
    assert run(vehicle, 2.0) == {"first"}
    vehicle.receive(encoder.encode(heartbeat()), "second", now=2.0)
    assert run(vehicle, 4.0) == {"first", "second"}
    run(vehicle, 10.5)
    assert run(vehicle, 11.9) == {"second"}
    run(vehicle, 12.5)
    assert run(vehicle, 20.0) == set()


def test_garbage_raises_nothing_changes_nothing_and_makes_no_peer() -> None:
    seed = random.randrange(2**32)
    print("seed", seed)
    noise = random.Random(seed)
    vehicle, encoder = fresh(), Encoder(Address(255, 190))
    valid = encoder.encode(heartbeat())
    for _ in range(10_000):
        data = bytearray(noise.randbytes(noise.randrange(64)))
        if noise.random() < 0.5:  # near misses: a valid packet with a few bytes changed
            data = bytearray(valid)
            data[noise.randrange(10, len(data))] ^= noise.randrange(1, 256)
        vehicle.receive(bytes(data), "noise", now=0.0)
    assert run(vehicle, 2.0) == set()
    assert not vehicle.autopilot.armed


def test_sequence_numbers_count_without_gaps() -> None:
    vehicle, encoder = fresh(), Encoder(Address(255, 190))
    vehicle.receive(encoder.encode(heartbeat()), "peer", now=0.0)
    while vehicle.next_deadline() < 5.0:
        vehicle.handle_deadline(now=vehicle.next_deadline())
    numbers = [data[4] for _, data in vehicle.take_packets()]
    assert numbers == [index % 256 for index in range(len(numbers))]


def test_a_change_of_mode_is_seen_with_the_next_beat_and_no_sooner() -> None:
    """As observed: HEARTBEAT comes at 1 Hz, whatever happens between."""
    vehicle = fresh()
    vehicle.receive(Encoder(Address(255, 190)).encode(heartbeat()), "peer", now=0.0)
    decoder = Decoder()
    seen: list[tuple[float, int]] = []
    for step in range(1, 161):
        now = step * 0.025
        if step == 90:
            vehicle.autopilot.operator_mode(Mode.HOLD, now=now)
        vehicle.handle_deadline(now=now)
        for _, data in vehicle.take_packets():
            message = decoder.decode(split_datagram(data)[0])
            if isinstance(message, m.Heartbeat):
                seen.append((now, message.custom_mode))
    assert [late - early for (early, _), (late, _) in pairwise(seen)] == pytest.approx(
        [1.0] * (len(seen) - 1), abs=0.03
    )
    assert [mode for at, mode in seen if at > 90 * 0.025] == [4, 4]
