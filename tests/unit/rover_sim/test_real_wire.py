"""What the real ones say that a tidy simulator would not."""

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.codec import Encoder
from rover_sim.body import Pose
from rover_sim.kinematic import KinematicBody
from rover_sim.personas import ARDUPILOT, PX4
from rover_sim.vehicle import Peers, Vehicle, make_vehicle
from tests.unit.rover_sim.rig import CLIENT, RealRig, heartbeat

UNNUMBERED = 65535


def test_ardupilot_sends_a_parameter_unasked_that_has_no_number() -> None:
    rig = RealRig(ARDUPILOT)
    rig.run(61.0)
    values = rig.take(m.ParamValue)
    assert [(v.param_id, v.param_value, v.param_index) for v in values] == [
        ("STAT_RUNTIME", 30.0, UNNUMBERED),
        ("STAT_RUNTIME", 60.0, UNNUMBERED),
    ]
    rig.send(m.ParamRequestList(1, 1))
    listed = rig.take(m.ParamValue)
    assert [v.param_index for v in listed] == list(range(listed[0].param_count))
    assert listed[-1].param_id == "STAT_RUNTIME"


def met(peers: Peers) -> Vehicle:
    body = KinematicBody(start=Pose(), slip=0.0, seed=None)
    vehicle = make_vehicle(body, system_id=1, now=0.0, persona=PX4, peers=peers)
    beat = Encoder(CLIENT).encode(heartbeat())
    for peer in ("first", "second"):
        vehicle.receive(beat, peer, now=0.0)
    return vehicle


def talked_to(vehicle: Vehicle, until: float) -> set[object]:
    while vehicle.next_deadline() < until:
        vehicle.handle_deadline(now=vehicle.next_deadline())
    return {peer for peer, _ in vehicle.take_packets()}


def test_a_rover_that_answers_its_first_peer_only_keeps_to_it_for_good() -> None:
    vehicle = met(Peers.FIRST)
    assert talked_to(vehicle, 1.0) == {"first"}
    assert talked_to(vehicle, 30.0) == {"first"}  # though it has fallen silent
    vehicle.receive(Encoder(CLIENT).encode(heartbeat()), "second", now=30.0)
    assert talked_to(vehicle, 31.0) == {"first"}
