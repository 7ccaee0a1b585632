"""The end of a move on rovers that do not move slowly, and roll on."""

from functools import partial

from mav_tasks.tasks.lifecycle import TaskState
from tests.kit.bodies import Sticky
from tests.kit.cases import for_each
from tests.scenarios.conftest import MakeWorld

S = TaskState


@for_each("least", [0.02, 0.1])
@for_each("rolling", [0.9, 0.3, 0.2])
def test_moves_end_as_near_as_the_rover_can_and_none_is_stuck(
    make_world: MakeWorld, least: float, rolling: float
) -> None:
    world = make_world(body=partial(Sticky, least=least, rolling=rolling))
    wanted, errors = 0.0, []
    for number, metres in enumerate((2.0, 0.3, -1.0, 3.0, 0.5, -0.4), start=1):
        world.client.move(metres)
        world.until_state(number, S.COMPLETED, within=60)
        wanted += metres
        world.until(world.stands, within=5)
        errors.append(abs(world.truth.north - wanted))
        wanted = world.truth.north  # the next one begins where this one ended
    assert max(errors) <= 0.1, errors
    assert sorted(errors)[2] <= 0.05, errors


def test_one_that_does_not_follow_is_told_of_within_3_s(make_world: MakeWorld) -> None:
    world = make_world(body=partial(Sticky, least=9.0, rolling=0.9))
    world.client.move(5.0)
    world.until_state(1, S.EXECUTING)
    active = world.now
    words = "does not move (told 0.5 m/s)"
    world.until(lambda: world.client.said(words), within=3.0)
    assert world.state(1)[0] is S.EXECUTING, "before it is stuck"
    assert world.now - active < 3.0
    world.until_state(1, S.FAILED)
