"""QGroundControl connects without a popup, to every make of rover, alone or with others."""

from pathlib import Path

from rover_sim.personas import Persona
from tests.kit.qgc.joined import each_make, each_version, join, place, slowest_ack
from tests.kit.qgc.plan_master import Plan
from tests.kit.qgc.profile import V4, Profile
from tests.kit.qgc.session import BACK, LOST
from tests.kit.store import PromptSqliteStore
from tests.scenarios.conftest import MakeWorld

ACK_IN_TIME = 0.6  # s; the least patient one waits 1.2
AUTOPILOT, TASK_SERVER = (1, 1), (1, 191)


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


@each_version
def test_a_server_that_is_started_again_is_lost_and_back_and_nothing_else(
    make_world: MakeWorld, tmp_path: Path, profile: Profile
) -> None:
    path = tmp_path / "tasks.sqlite3"
    store = PromptSqliteStore(path, wall_offset=1.8e9)
    world = make_world(store=store)
    party = join(world, profile)
    world.run(8)  # until nothing more is asked
    world.end_server()
    store.close()
    world.run(6)
    sent = len(party.qgc.sent)
    later = PromptSqliteStore(path, wall_offset=1.8e9)
    world.start_server(later, later.load())
    world.run(6)
    assert [each.text for each in party.qgc.screen.notices] == [LOST, BACK]
    assert {name for _, name, _ in party.qgc.sent[sent:]} <= {"HEARTBEAT", "REQUEST_DATA_STREAM"}
    assert party.qgc.screen.complaints == []


@each_version
def test_the_servers_own_parameters_are_a_component_of_their_own(
    make_world: MakeWorld, profile: Profile
) -> None:
    world = make_world()
    party = join(world, profile)
    world.run(5)
    assert set(party.vehicle.parameters.components) == {1, 191}
    names = party.vehicle.parameters.components[191].names
    assert all(name.startswith("TSK_") for name in names)
    party.check()


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
