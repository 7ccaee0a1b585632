"""mavros with its defaults, whose address is the server's own inside the rover's system."""

from mav_tasks.tasks.events import SubmissionRefused
from rover_sim.personas import Persona
from tests.kit.cases import anew, for_each
from tests.kit.client import ACCEPTED, ARM, AUTO, GUIDED, HOLD
from tests.kit.mavros import Mavros
from tests.kit.mission import Item
from tests.kit.observer import ARDUPILOT_WAYS
from tests.kit.px4 import MISSION, PROMPT_PX4
from tests.kit.world import PROMPT, World, at, is_at
from tests.scenarios.conftest import MakeWorld

WAYPOINT = 16
HOME = Item(WAYPOINT, **at(0, 0))


@anew
def world(make_world: MakeWorld, persona: Persona) -> World:
    return make_world(persona=persona)


def is_ardupilot(world: World) -> bool:
    return world.observer.ways is ARDUPILOT_WAYS


@for_each("persona", [PROMPT, PROMPT_PX4])
def test_stock_mavros_is_served(world: World) -> None:
    mavros = Mavros(world)
    world.run(17)
    connected, armed, _ = mavros.state
    assert (connected, armed) == (True, False)
    for asked in ("AUTOPILOT_VERSION", "PARAM_VALUE", "HOME_POSITION", "TIMESYNC"):
        assert mavros.client.heard(asked), asked
    assert mavros.waypoints == []
    items = [Item(WAYPOINT, **at(north, 0)) for north in (1.0, 2.0)]
    assert mavros.push([HOME, *items] if is_ardupilot(world) else items)
    assert mavros.pull()
    assert [each.x for each in mavros.waypoints or ()][-2:] == [each.x for each in items]
    armed_by = mavros.arm()
    world.run(0.5)
    assert armed_by.result == ACCEPTED
    assert mavros.state[1]
    mavros.set_mode(AUTO if is_ardupilot(world) else MISSION)
    world.until_idle(tasks=1, within=60)
    assert is_at(world, 2.0, 0.0)
    assert world.events(SubmissionRefused) == []


def test_two_with_one_address_are_told_apart_by_where_they_are(make_world: MakeWorld) -> None:
    world = make_world()
    one, other = Mavros(world, "one"), Mavros(world, "other")
    world.run(2)
    one.velocity(0.5)
    one.set_mode(GUIDED)
    world.run(0.5)
    one.arm()
    world.until_faster(0.4, within=4)
    assert other.client.acks_of(ARM) == [], "nobody gets the other's answer"
    other.velocity(-0.5)
    world.run(1)
    assert world.truth.forward_speed > 0.4, "nor drives by what was granted to the other"
    dropped = [text for text in other.client.texts() if "setpoints" in text]
    assert len(dropped) == 1, "which it is told once"
    other.client.heartbeats = False
    stopped = other.client.stop(target=(1, 1))
    world.until(world.stands, within=4)
    assert stopped.result == ACCEPTED


@for_each("halt", [HOLD, None])
def test_it_arms_right_after_its_own_halt(make_world: MakeWorld, halt: int | None) -> None:
    """Each arming of mavros says that it is a repeat, and none is."""
    world = make_world()
    mavros = Mavros(world)
    world.run(4)
    if halt is None:
        mavros.arm()
        world.run(1)
        mavros.arm(False)
    else:
        mavros.set_mode(halt)
    world.run(1)
    again = mavros.arm()
    world.run(1)
    assert again.result == ACCEPTED
    assert world.is_armed
