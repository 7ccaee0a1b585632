"""When the server disarms a rover: who armed it, and who has said that it has done with it."""

from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, Persona
from tests.kit.cases import for_each
from tests.kit.client import (
    ACCEPTED,
    GUIDED,
    HOLD,
    RTL,
    Sent,
    setpoint,
)
from tests.kit.px4 import OFFBOARD, PROMPT_PX4, RETURN, ask_mode
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

BOTH = for_each("persona", [ARDUPILOT, PROMPT_PX4])
LAND, TAKEOFF = 21, 22
HANDED_BACK = 6.0  # s after a task, in which the server has HOLD shown and disarms


@BOTH
@for_each("at", [S.STARTING, S.EXECUTING])
def test_a_rover_that_a_client_arms_while_a_task_drives_stays_armed(
    make_world: MakeWorld, persona: Persona, at: S
) -> None:
    world = make_world(persona=persona)
    world.client.move(1.0)
    world.until_state(1, at)
    sent = world.client.arm(True)
    world.run(0.3)
    assert sent.result == ACCEPTED
    world.until_state(1, S.COMPLETED, within=20)
    world.run(HANDED_BACK)
    assert world.is_armed


@BOTH
def test_a_client_that_arms_while_the_server_disarms_has_the_last_word(
    make_world: MakeWorld, persona: Persona
) -> None:
    world = make_world(persona=persona)
    world.client.move(0.5)
    world.until(lambda: world.control() == "DISARMING", within=20)
    world.client.arm(True)
    world.run(HANDED_BACK)
    assert world.is_armed


@BOTH
def test_a_person_who_arms_while_the_server_disarms_has_the_last_word(
    make_world: MakeWorld, persona: Persona
) -> None:
    world = make_world(persona=persona)
    world.client.move(0.5)
    world.until_state(1, S.COMPLETED)
    world.until(lambda: not world.rover.autopilot.armed, within=20)
    world.operator_arm(True)
    world.client.move(0.5)
    world.until_state(2, S.COMPLETED, within=20)
    world.run(HANDED_BACK)
    assert world.is_armed


def test_what_a_client_disarms_and_a_person_arms_again_stays_armed(world: World) -> None:
    world.client.move(0.5)
    world.until_state(1, S.EXECUTING)
    world.client.arm(False)
    world.run(6)
    world.operator_arm(True)
    world.run(2)
    world.client.proceed()
    world.until_state(1, S.COMPLETED)
    world.run(HANDED_BACK)
    assert world.is_armed


def armed_by_client(make_world: MakeWorld, persona: Persona) -> World:
    world = make_world(persona=persona)
    if persona is ARDUPILOT:
        world.client.mode(HOLD)  # armed in MANUAL it would be a person's
    world.client.arm(True)
    world.run(1.2)
    assert world.is_armed
    return world


def returns(world: World, persona: Persona) -> None:
    """Ask for the mode RTL, and wait until the rover is at home."""
    count = len(world.tasks())
    sent = world.client.mode(RTL) if persona is ARDUPILOT else ask_mode(world.client, RETURN)
    world.run(0.3)
    assert sent.task_id == count + 1
    world.until_state(sent.task_id, S.COMPLETED, within=30)


@BOTH
def test_a_return_ends_disarmed_whoever_armed_the_rover(
    make_world: MakeWorld, persona: Persona
) -> None:
    """MAVSDK's fly_mission waits for that after return_to_launch."""
    world = armed_by_client(make_world, persona)
    world.client.move(1.0)
    world.until_state(1, S.COMPLETED, within=20)
    world.run(HANDED_BACK)
    assert world.is_armed
    returns(world, persona)
    world.run(HANDED_BACK)
    assert not world.is_armed


def land(world: World) -> Sent:
    sent = world.client.command(LAND, target=(1, 1))
    world.run(0.2)
    return sent


@BOTH
def test_takeoff_and_land_are_both_accepted_and_land_disarms(
    make_world: MakeWorld, persona: Persona
) -> None:
    """The first and the last line of many a script."""
    world = armed_by_client(make_world, persona)
    takeoff = world.client.command(TAKEOFF, target=(1, 1))
    world.run(0.2)
    assert (takeoff.result, land(world).result) == (ACCEPTED, ACCEPTED)
    world.run(HANDED_BACK)
    assert not world.is_armed
    assert world.tasks() == ()


@BOTH
def test_land_ends_what_its_client_drives_by_setpoints(
    make_world: MakeWorld, persona: Persona
) -> None:
    world = armed_by_client(make_world, persona)
    world.client.stream(setpoint(0.6), rate=20)
    world.run(0.3)
    _ = world.client.mode(GUIDED) if persona is ARDUPILOT else ask_mode(world.client, OFFBOARD)
    world.run(2)
    assert world.truth.forward_speed > 0.4
    land(world)
    world.run(HANDED_BACK)
    assert (world.stands(), world.is_armed) == (True, False)
