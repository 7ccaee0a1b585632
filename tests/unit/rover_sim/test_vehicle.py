"""A vehicle on its link: several peers, and time that is the caller's."""

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from rover_sim.body import Pose
from rover_sim.kinematic import KinematicBody
from rover_sim.vehicle import Vehicle, make_vehicle
from tests.unit.rover_sim.rig import heartbeat


def fresh() -> Vehicle:
    body = KinematicBody(start=Pose(), slip=0.0, seed=None)
    return make_vehicle(body, system_id=1, now=0.0)


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
