"""A client's own OFFBOARD on a PX4 rover, which is entered only while setpoints stream."""

from typing import Any

from pymavlink.dialects.v20 import common

from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import PX4, Mode, Persona
from tests.kit.cases import anew, for_each
from tests.kit.client import ACCEPTED, setpoint
from tests.kit.px4 import OFFBOARD, PROMPT_GENERIC, PROMPT_PX4, ask_mode
from tests.kit.rows import check
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

VELOCITY_NED = 2503  # MAVSDK's mask: velocity and yaw


@anew
def world(make_world: MakeWorld, persona: Persona) -> World:
    """An armed rover and a client that streams."""
    world = make_world(persona=persona)
    world.client.arm()
    world.run(0.3)
    world.client.stream(northwards(0.5), rate=20)
    world.run(0.5)
    assert world.stands()
    return world


def northwards(speed: float) -> Any:
    return common.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 1, VELOCITY_NED, 0, 0, 0, speed, 0, 0, 0, 0, 0, 0, 0
    )


@for_each("persona", [PROMPT_PX4, PROMPT_GENERIC])
def test_drives_the_rover_from_when_it_is_asked_for_until_hold(world: World) -> None:
    """No task of ours is driving: HOLD leaves at once. The stream goes on, and is not passed."""
    check(
        world,
        """
DO_SET_MODE 1 6 to=autopilot & wait 0.2 : ACCEPTED mode guided
faster 0.4 : -
HOLD & wait 0.05 : ACCEPTED it gets hold
wait 2 : - it STANDS
wait 2 : - it STANDS
""",
    )


@for_each("again", [False, True])
def test_the_recipe_of_stream_mode_and_arming_drives(make_world: MakeWorld, *, again: bool) -> None:
    """PX4's example: until it is armed, zeros stand in for the setpoints; its client is told."""
    world = make_world(persona=PX4)
    world.client.reads_dialect = False
    world.until(lambda: world.client.heard("LOCAL_POSITION_NED"), within=10)
    world.client.stream(northwards(1.0), rate=20)
    world.run(2)
    begun = world.now
    ask_mode(world.client, OFFBOARD)
    world.run(5)
    assert world.stands()
    streamed = [e for e in world.observer.sent_since(begun) if e in ("zero", "move")]
    assert len(streamed) > 90
    assert set(streamed) == {"zero"}
    for _ in range(1 + again):
        if again:
            ask_mode(world.client, OFFBOARD)
        armed = world.client.arm()
        world.run(0.5)
    assert armed.result == ACCEPTED
    world.until_faster(0.5, within=5)
    assert world.mode() is Mode.GUIDED
    assert [t for t in world.client.texts() if "setpoints dropped" in t] == [
        "setpoints dropped: set Offboard first",
        "setpoints dropped: the rover is not armed",
    ]


@for_each("persona", [PROMPT_PX4, PROMPT_GENERIC])
def test_does_not_come_back_when_a_task_has_ended(world: World) -> None:
    check(world, "DO_SET_MODE 1 6 to=autopilot & wait 1 : ACCEPTED")
    world.client.end_streams()
    world.client.stream(setpoint(0.0), rate=5)
    world.run(0.5)
    world.client.end_streams()
    check(world, "wait 2.5 : -\nTASK_MOVE 1 & until 1 EXECUTING within=10 : ACCEPTED")
    world.client.stream(northwards(-0.5), rate=20)
    world.until_state(1, S.COMPLETED, within=20)
    where = world.truth.north
    check(world, "wait 3 : - it STANDS")
    assert abs(world.truth.north - where) < 0.02
