"""When the server disarms a rover: who armed it, and who has said that it has done with it."""

from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, Persona
from tests.kit.cases import for_each
from tests.kit.client import (
    GUIDED,
    HOLD,
    setpoint,
)
from tests.kit.px4 import OFFBOARD, PROMPT_PX4, ask_mode
from tests.kit.rows import check
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

BOTH = for_each("persona", [ARDUPILOT, PROMPT_PX4])
HANDED_BACK = 6.0  # s after a task, in which the server has HOLD shown and disarms


@BOTH
@for_each("at", ["STARTING", "EXECUTING"])
def test_a_rover_that_a_client_arms_while_a_task_drives_stays_armed(
    make_world: MakeWorld, persona: Persona, at: str
) -> None:
    check(
        make_world(persona=persona),
        f"""
TASK_MOVE 1 & until 1 {at} & ARM 1 & until 1 COMPLETED : ACCEPTED+ACCEPTED
wait 6 : - it is ARMED
""",
    )


@BOTH
def test_a_client_that_arms_while_the_server_disarms_has_the_last_word(
    make_world: MakeWorld, persona: Persona
) -> None:
    world = make_world(persona=persona)
    world.client.move(0.5)
    world.until(lambda: world.control() == "DISARMING", within=20)
    check(world, "ARM 1 & wait 6 : ACCEPTED it is ARMED")


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
    check(
        world,
        """
TASK_MOVE 0.5 & until 1 EXECUTING : ACCEPTED
ARM 0 & wait 6 : ACCEPTED it is DISARMED
operator arms & wait 2 : -
CONTINUE & until 1 COMPLETED : ACCEPTED
wait 6 : - it is ARMED
""",
    )


def armed_by_client(make_world: MakeWorld, persona: Persona) -> World:
    world = make_world(persona=persona)
    if persona is ARDUPILOT:
        world.client.mode(HOLD)  # armed in MANUAL it would be a person's
    world.client.arm(True)
    world.run(1.2)
    assert world.is_armed
    return world


@BOTH
def test_a_return_ends_disarmed_whoever_armed_the_rover(
    make_world: MakeWorld, persona: Persona
) -> None:
    """MAVSDK's fly_mission waits for that after return_to_launch."""
    world = armed_by_client(make_world, persona)
    mode = "11" if persona is ARDUPILOT else "4 5"
    check(
        world,
        f"""
TASK_MOVE 1 & until 1 COMPLETED : ACCEPTED
wait 6 : - it is ARMED
DO_SET_MODE 1 {mode} to=autopilot & until 2 COMPLETED : ACCEPTED #2
wait 6 : - it is DISARMED
""",
    )


@BOTH
def test_takeoff_and_land_are_both_accepted_and_land_disarms(
    make_world: MakeWorld, persona: Persona
) -> None:
    """The first and the last line of many a script."""
    world = armed_by_client(make_world, persona)
    check(
        world,
        """
NAV_TAKEOFF to=autopilot : ACCEPTED
NAV_LAND to=autopilot & wait 6 : ACCEPTED it is DISARMED
""",
    )
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
    check(world, "NAV_LAND to=autopilot & wait 6 : ACCEPTED it STANDS / it is DISARMED")
