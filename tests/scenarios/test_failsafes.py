"""Failsafes of the rover's own: they are called so, and its own fence keeps tasks waiting."""

import pytest

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from rover_sim.personas import ARDUPILOT, PX4, Persona
from tests.kit.cases import anew, for_each
from tests.kit.rows import check
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

OUTSIDE = Faults(outside_fence=True)
OUTSIDE_WORDS = "Task 1 waits: outside its own fence; drive it back by hand"


def driving_world(make_world: MakeWorld, persona: Persona) -> World:
    """A world in which a task drives."""
    world = make_world(persona=persona)
    world.client.move(6)
    world.until_state(1, S.EXECUTING, within=20)
    world.run(2)
    return world


@anew
def driving(make_world: MakeWorld, persona: Persona) -> World:
    """A world in which a task drives."""
    return driving_world(make_world, persona)


@for_each("persona", [ARDUPILOT, PX4])
def test_a_mode_that_a_failsafe_sets_is_no_person_s_takeover(driving: World) -> None:
    world = driving
    world.fault(Faults(gps_lost=True))
    world.until(lambda: world.paused() is R.FAILSAFE, within=10)
    assert world.state(1)[0] is S.PAUSED
    assert world.client.said("set by its failsafe: ")


class TestOwnFence:
    """Of an ArduPilot: no text tells of a breach, SYS_STATUS does a moment later."""

    @pytest.fixture
    def outside(self, make_world: MakeWorld) -> World:
        """A world whose rover has left its own fence in mid-task."""
        world = driving_world(make_world, ARDUPILOT)
        world.fault(OUTSIDE)
        world.until(lambda: world.paused() is R.FAILSAFE, within=3)
        return world

    def test_nothing_drives_on_outside_though_it_is_continued(self, outside: World) -> None:
        world = outside
        world.run(3)
        before = world.truth
        world.client.proceed()
        world.run(10)
        assert (world.truth.north, world.truth.east) == pytest.approx(
            (before.north, before.east), abs=0.02
        )
        assert world.client.said("is outside its own fence")

    def test_a_task_that_comes_while_it_is_outside_waits_and_says_why(
        self, make_world: MakeWorld
    ) -> None:
        check(
            make_world(persona=ARDUPILOT),
            f"""
    fault outside_fence=1 & wait 3 : -
    TASK_MOVE 2 & wait 3 : ACCEPTED {OUTSIDE_WORDS}
    SHOW 1 : ACCEPTED status 1: QUEUED OUTSIDE_OWN_FENCE
    fault & until 1 COMPLETED within=40 : -
    """,
        )
