"""When the server disarms a rover: who armed it, and who has said that it has done with it."""

import pytest

from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, Persona
from tests.kit.client import ACCEPTED
from tests.kit.px4 import PROMPT_PX4
from tests.scenarios.conftest import MakeWorld

BOTH = pytest.mark.parametrize("persona", [ARDUPILOT, PROMPT_PX4], ids=lambda each: each.name)
HANDED_BACK = 6.0  # s after a task, in which the server has HOLD shown and disarms


@BOTH
@pytest.mark.parametrize("at", [S.STARTING, S.EXECUTING])
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
    assert world.rover.autopilot.armed


@BOTH
def test_a_client_that_arms_while_the_server_disarms_has_the_last_word(
    make_world: MakeWorld, persona: Persona
) -> None:
    world = make_world(persona=persona)
    world.client.move(0.5)
    world.until(lambda: world.control() == "DISARMING", within=20)
    world.client.arm(True)
    world.run(HANDED_BACK)
    assert world.rover.autopilot.armed


@BOTH
def test_a_rover_that_nobody_else_armed_is_disarmed_when_its_queue_is_empty(
    make_world: MakeWorld, persona: Persona
) -> None:
    world = make_world(persona=persona)
    world.client.move(0.5)
    world.until_state(1, S.COMPLETED, within=20)
    world.run(HANDED_BACK)
    assert not world.rover.autopilot.armed
