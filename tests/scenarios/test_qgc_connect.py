"""QGroundControl connects without a popup, to every make of rover, alone or with others."""

from collections import Counter
from pathlib import Path
from random import Random

from mav_tasks.in_memory import CLIENT_LINK
from rover_sim.personas import Persona
from tests.kit.qgc.joined import each_make, each_version, join, place, slowest_ack
from tests.kit.qgc.party import QgcParty
from tests.kit.qgc.plan_master import Plan
from tests.kit.qgc.profile import V4, Profile
from tests.kit.qgc.session import BACK, LOST
from tests.kit.store import PromptSqliteStore
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

ACK_IN_TIME = 0.6  # s; the least patient one waits 1.2
AUTOPILOT, TASK_SERVER = (1, 1), (1, 191)


class Losses:
    """Loses a share of what goes to a station, and counts it by source as the station must."""

    def __init__(self, world: World, party: str, *, share: float, seed: int) -> None:
        self._random = Random(seed)
        self._share = share
        self._party = party
        self._since: Counter[tuple[int, int]] = Counter()
        #: lost between two packets that came: what sequence numbers can show
        self.visible: Counter[tuple[int, int]] = Counter()
        self._known: set[tuple[int, int]] = set()
        world.watched.loses = self.loses

    def loses(self, source: str, target: str, data: bytes) -> bool:
        if (source, target) != (CLIENT_LINK, self._party):
            return False
        address = (data[5], data[6])
        if self._random.random() < self._share:
            self._since[address] += 1
            return True
        lost = self._since.pop(address, 0)
        if address in self._known:
            self.visible[address] += lost
        self._known.add(address)
        return False


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
def test_it_sees_no_loss_but_what_was_lost(make_world: MakeWorld, persona: Persona) -> None:
    world = make_world(persona=persona)
    party = QgcParty(world.net, "qgc", V4)
    losses = Losses(world, "qgc", share=0.05, seed=7)
    world.join(party)
    world.until(lambda: party.is_connected, within=30)
    world.run(25)
    assert losses.visible[AUTOPILOT] > 10
    assert party.qgc.lost == +losses.visible
    assert party.popups == []


@each_make
def test_a_parameter_is_edited(make_world: MakeWorld, persona: Persona) -> None:
    world = make_world(persona=persona)
    party = join(world, V4)
    name = persona.speed_parameter
    party.vehicle.parameters.set(name, 1.5, 9)
    world.run(4)
    assert party.vehicle.parameters.value(name) == 1.5
    assert world.rover.autopilot.parameters[name] == 1.5
    party.check()


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
@each_make
def test_two_stations_get_each_their_own_answers(
    make_world: MakeWorld, persona: Persona, profile: Profile
) -> None:
    """Both are 255/190: an ack, an item or a request that strays is taken for one's own."""
    world = make_world(persona=persona)
    stations = [join(world, profile, name) for name in ("one", "two")]
    acks = []
    for number in range(6):  # the same number at once, now to the rover and now to the server
        component = (1, 191)[number % 2]
        sent = [s.operator.action(54000, 1.0 + number, component=component) for s in stations]
        world.run(0.004 * number)
        asked = [s.operator.action(512, 148) for s in stations[: number % 3]]
        world.run(0.6)
        acks += [each.task_id for each in sent]
        assert all(each.result == 0 for each in [*sent, *asked])
    assert sorted(acks) == list(range(1, 13)), "each press of each station its own task"
    plans = [Plan(place(0, 0), [place(n, 0), place(n, 1)]) for n in (2, 3)]
    for station, plan in zip(stations, plans, strict=True):
        station.plans.upload(plan)
        world.run(2)
        assert station.plans.outcome == {0: True, 1: True, 2: True}
    for station in stations:
        station.plans.download()
    world.run(2)
    first, second = (station.plans.managers[0].known for station in stations)
    assert first is not None
    assert second is not None
    assert [item.key for item in first] == [item.key for item in second]
    for station in stations:
        assert station.qgc.screen.complaints == []
        assert slowest_ack(station) < ACK_IN_TIME
        assert set(station.qgc.lost) <= {TASK_SERVER}


@each_version
def test_the_servers_own_parameters_are_a_component_of_their_own(
    make_world: MakeWorld, profile: Profile
) -> None:
    world = make_world()
    party = join(world, profile)
    world.run(5)
    assert set(party.vehicle.parameters.components) == {1, 191}
    names = party.vehicle.parameters.components[191].values
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
