"""A release decides about a task; that the rover goes on, a continue says: attack D6."""

import pytest

from mav_tasks.settings import Roles, Settings
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, DENIED, HOLD
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

RELEASE, AGAIN, REMAINDER = 54013, 0, 1
PAUSES = ("pause", "HOLD", "takeover")


def held_and_paused(world: World, how: str) -> None:
    """Have a task held, and then the queue paused."""
    world.client.move(10)
    world.until(lambda: world.truth.forward_speed > 0.3, within=10)
    world.fault(Faults(position_jump=(5.0, 0.0)))
    world.until_state(1, S.HELD, within=2)
    world.run(3)
    if how == "pause":
        world.add_client("person").pause()
    elif how == "HOLD":
        world.add_client("person").mode(HOLD)
    else:
        world.operator_mode(Mode.MANUAL)
        world.run(2)
        world.operator_mode(Mode.HOLD)
    world.run(5)


@for_each("how", PAUSES)
def test_it_waits_for_the_continue_and_then_goes_on(world: World, how: str) -> None:
    held_and_paused(world, how)
    before = world.pose()
    released = world.client.command(RELEASE, 1, AGAIN)
    world.run(5)
    assert released.answer == (ACCEPTED, 1)
    assert world.pose() == pytest.approx(before, abs=0.001)
    assert world.state(1)[0] is S.HELD
    assert "Task 1 waits: released; press Continue to start it" in world.client.texts()
    world.client.proceed()
    world.until_state(1, S.EXECUTING, within=5)


@for_each("how", PAUSES)
def test_the_next_halt_takes_it_back(world: World, how: str) -> None:
    held_and_paused(world, how)
    world.client.command(RELEASE, 1, AGAIN)
    world.run(1)
    world.add_client("another").pause()
    world.run(5)
    before = world.pose()
    world.client.proceed()
    world.run(4)
    assert world.pose() == pytest.approx(before, abs=0.001)
    assert world.state(1)[0] is S.HELD


def test_a_submitter_who_may_not_continue_does_not_drive_by_a_release(
    make_world: MakeWorld,
) -> None:
    roles = Roles(addresses={"245/190": "submitter"})
    world = make_world(settings=Settings(roles=roles))
    script = world.add_client("script", system_id=245)
    script.move(10)
    world.until(lambda: world.truth.forward_speed > 0.3, within=10)
    world.fault(Faults(position_jump=(5.0, 0.0)))
    world.until_state(1, S.HELD, within=2)
    world.run(3)
    world.client.pause()
    world.run(4)
    before = world.pose()
    continued = script.proceed()
    script.command(RELEASE, 1, AGAIN)
    world.run(5)
    assert continued.result == DENIED
    assert world.pose() == pytest.approx(before, abs=0.001)
