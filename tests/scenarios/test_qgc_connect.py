"""QGroundControl connects without a popup, to every make of rover, alone or with others."""

from rover_sim.personas import Persona
from tests.kit.qgc.joined import each_make, each_version, join, place, slowest_ack
from tests.kit.qgc.plan_master import Plan
from tests.kit.qgc.profile import V4, Profile
from tests.scenarios.conftest import MakeWorld

ACK_IN_TIME = 0.6  # s; the least patient one waits 1.2
TASK_SERVER = (1, 191)


@each_version
@each_make
def test_it_connects_and_stays_without_a_complaint(
    make_world: MakeWorld, persona: Persona, profile: Profile
) -> None:
    world = make_world(persona=persona)
    party = join(world, profile)
    world.run(20)
    party.check()
    asked = [
        message.mission_type
        for _, name, message in party.qgc.sent
        if name == "MISSION_REQUEST_LIST"
    ]
    assert asked == [0, 1, 2], "all three types, each asked once"
    assert party.qgc.count_sent("PARAM_REQUEST_LIST") == 1
    assert party.vehicle.parameters.components[1].missing == set()
    assert slowest_ack(party) < ACK_IN_TIME
    assert not party.qgc.wire.sends_mavlink1
    assert party.qgc.wire.received[TASK_SERVER] > 15
    assert party.qgc.screen.notices == []


@each_make
def test_one_that_uploads_while_another_does_is_told_so(
    make_world: MakeWorld, persona: Persona
) -> None:
    world = make_world(persona=persona)
    stations = [join(world, V4, name) for name in ("one", "two")]
    for station in stations:
        station.plans.upload(Plan(place(0, 0), [place(2, 0)] * 3))
    world.run(12)
    outcomes = [station.plans.outcome[0] for station in stations]
    assert outcomes.count(True) >= 1
    for station, succeeded in zip(stations, outcomes, strict=True):
        denied = [text for text in station.popups if text.startswith("Mission transfer failed")]
        assert bool(denied) is not succeeded
        assert station.qgc.screen.violations == []
