"""Plans of QGroundControl: sent, driven to the end, read, replaced while driving, removed."""

from math import hypot

from mav_tasks.shell.in_memory import CLIENT_LINK
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode, Persona
from tests.kit.cases import for_each
from tests.kit.mission import ITEM_INT, REQUEST, REQUEST_INT
from tests.kit.qgc.joined import each_guided, each_version, join, place, slowest_ack
from tests.kit.qgc.party import QgcParty
from tests.kit.qgc.plan_master import Plan
from tests.kit.qgc.profile import Profile
from tests.kit.world import PROMPT, World
from tests.scenarios.conftest import MakeWorld

FENCE = [place(n, e) for n, e in ((-9, -9), (-9, 9), (9, 9), (9, -9))]
FIRST = Plan(place(0, 0), [place(1.5, 0), place(1.5, 1)], fence=FENCE, rally=[place(0, 0.5)])
NEXT = FIRST._replace(waypoints=[place(0.5, 1)], speed=0.4)
ALL_WELL = {0: True, 1: True, 2: True}


def is_near(world: World, north: float, east: float) -> bool:
    """Whether the rover stands where a plan ends; a PX4 one slides a little."""
    return hypot(world.truth.north - north, world.truth.east - east) < 0.1


def upload(world: World, party: QgcParty, plan: Plan, *, within: float = 5) -> None:
    """Send a plan and wait until the plan view says it is done."""
    party.plans.upload(plan)
    world.until(lambda: party.plans.is_done, within=within)
    assert party.plans.outcome == ALL_WELL, party.popups


def assert_read_back(party: QgcParty, plan: Plan, firmware: str) -> None:
    managers = party.plans.managers
    sent = plan.mission(firmware), plan.fence_items(), plan.rally_items()
    for kind, items in enumerate(sent):
        known = managers[kind].known
        assert known is not None
        assert [item.key for item in known] == [item.key for item in items]


@each_version
@each_guided
def test_from_the_upload_to_the_removal(
    make_world: MakeWorld, persona: Persona, profile: Profile
) -> None:
    world = make_world(persona=persona)
    party = join(world, profile)
    upload(world, party, FIRST)
    assert "start" in party.operator.offers
    party.operator.start()
    world.until_state(1, S.EXECUTING, within=15)
    world.until(lambda: world.truth.north > 0.5, within=20)
    assert party.operator.offers >= {"emergency stop", "return", "go to", "pause"}
    upload(world, party, NEXT)
    assert world.state(1)[0] is S.EXECUTING, "another plan does not disturb the one that is driven"
    world.until_state(1, S.COMPLETED, within=60)
    assert is_near(world, 1.5, 1.0)
    party.operator.go_on() if "continue" in party.operator.offers else party.operator.start()
    world.until_state(2, S.COMPLETED, within=60)
    assert is_near(world, 0.5, 1.0)
    party.plans.download()
    world.until(lambda: party.plans.is_done, within=5)
    assert_read_back(party, NEXT, party.vehicle.state.firmware)
    party.plans.remove()
    world.until(lambda: party.plans.is_done, within=5)
    assert party.plans.outcome == ALL_WELL
    party.plans.download()
    world.until(lambda: party.plans.is_done, within=5)
    assert [manager.known for manager in party.plans.managers.values()] == [()] * 3
    party.check()
    assert slowest_ack(party) < profile.ack_timeout / 2
    assert world.state(1)[0] is world.state(2)[0] is S.COMPLETED


@each_version
@each_guided
def test_is_interrupted_and_gone_on_with(
    make_world: MakeWorld, persona: Persona, profile: Profile
) -> None:
    world = make_world(persona=persona)
    party = join(world, profile)
    upload(world, party, FIRST._replace(waypoints=[place(3, 0), place(3, 3)]))
    party.operator.start()
    world.until(lambda: world.truth.north > 0.7, within=30)
    party.operator.pause_all()
    world.run(3)
    assert world.state(1) == (S.PAUSED, R.OPERATOR)
    assert world.stands()
    assert world.mode() is Mode.HOLD
    # an ArduPilot rover says in HOLD that it is on standby: for the station it does not fly
    party.operator.go_on() if "continue" in party.operator.offers else party.operator.start()
    world.until(lambda: world.truth.north > 2.0, within=20)
    assert world.state(1)[0] is S.EXECUTING
    party.operator.set_item(2 if persona is PROMPT else 1)
    world.until_state(1, S.COMPLETED, within=60)
    assert is_near(world, 3.0, 3.0)
    assert len(world.tasks()) == 1
    party.check()


@each_version
@for_each("lost", [(ITEM_INT,), (REQUEST, REQUEST_INT)])
def test_what_is_lost_of_an_upload_is_asked_for_again_in_time(
    make_world: MakeWorld, profile: Profile, lost: tuple[int, ...]
) -> None:
    """A station waits for 1.5 s and never sends again by itself."""
    world = make_world()
    party = join(world, profile)
    seen = 0

    def loses(source: str, target: str, data: bytes) -> bool:
        nonlocal seen
        if CLIENT_LINK not in (source, target) or data[7] not in lost or data[0] != 0xFD:
            return False
        seen += 1
        return seen % 3 == 0

    world.watched.loses = loses
    upload(world, party, FIRST._replace(waypoints=[place(n, 0) for n in range(8)]), within=30)
    assert seen > 12
    assert party.qgc.screen.complaints == []
