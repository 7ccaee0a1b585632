"""A click on the map of QGroundControl, in all the forms in which it comes: one task, no popup."""

import pytest

from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, Mode, Persona
from tests.kit.px4 import PROMPT_GENERIC, PROMPT_PX4
from tests.kit.qgc.guided import NOT_GUIDED
from tests.kit.qgc.joined import degrees, each_version, join
from tests.kit.qgc.party import QgcParty
from tests.kit.qgc.profile import MASTER, V4, V42, Profile
from tests.kit.world import PROMPT, World, is_at
from tests.scenarios.conftest import MakeWorld


def armed(world: World, party: QgcParty) -> None:
    party.operator.arm()
    world.until(lambda: "go to" in party.operator.offers, within=3)


@each_version
class TestGoTo:
    def test_of_px4_is_one_task(self, make_world: MakeWorld, profile: Profile) -> None:
        world = make_world(persona=PROMPT_PX4)
        party = join(world, profile)
        armed(world, party)
        party.operator.go_to(*degrees(2, 0))
        world.until_state(1, S.COMPLETED, within=40)
        assert is_at(world, 2.0, 0.0)
        assert len(world.tasks()) == 1
        party.check()

    def test_of_px4_without_the_capability_comes_as_command_long(
        self, make_world: MakeWorld, profile: Profile
    ) -> None:
        world = make_world(persona=PROMPT_PX4)
        party = join(world, profile)
        party.plans.capabilities &= ~8
        armed(world, party)
        party.operator.go_to(*degrees(3, 0))
        world.until_state(1, S.COMPLETED, within=40)
        assert abs(world.truth.north - 3.0) < 1.5, "a float32 of degrees resolves a metre or so"
        assert len(world.tasks()) == 1
        party.check()

    def test_of_ardupilot_a_second_one_is_another_task(
        self, make_world: MakeWorld, profile: Profile
    ) -> None:
        world = make_world()
        party = join(world, profile)
        armed(world, party)
        party.operator.go_to(*degrees(2, 0))
        world.until(lambda: world.truth.north > 0.5, within=20)
        party.operator.go_to(*degrees(2, 2))
        world.until_idle(tasks=2)
        assert is_at(world, 2.0, 2.0)
        assert party.qgc.count_sent("MISSION_ITEM") == 1, "the ack has told what it takes"
        party.check()

    def test_of_a_generic_rover_is_not_possible(
        self, make_world: MakeWorld, profile: Profile
    ) -> None:
        world = make_world(persona=PROMPT_GENERIC)
        party = join(world, profile)
        armed(world, party)
        party.operator.go_to(*degrees(2, 0))
        world.run(2)
        assert party.qgc.screen.complaints[0].endswith(NOT_GUIDED)
        assert world.tasks() == ()


@pytest.mark.parametrize(
    ("persona", "profile"), [(PROMPT, V4), (ARDUPILOT, MASTER)], ids=["prompt-v4", "1 Hz-master"]
)
@pytest.mark.parametrize("before", [Mode.MANUAL, Mode.HOLD, Mode.GUIDED])
def test_a_go_to_of_ardupilot_in_all_its_forms_is_one_task(
    make_world: MakeWorld, persona: Persona, profile: Profile, before: Mode
) -> None:
    """A command and an item; from another mode a change of mode between the two."""
    world = make_world(persona=persona)
    party = join(world, profile)
    party.operator.set_mode({Mode.MANUAL: 0, Mode.HOLD: 4, Mode.GUIDED: 15}[before])
    world.run(1.2)
    party.operator.arm()
    world.run(1.2)
    assert "go to" in party.operator.offers
    party.operator.go_to(*degrees(2, 0))
    world.until_state(1, S.COMPLETED, within=40)
    world.run(3)
    assert is_at(world, 2.0, 0.0)
    assert len(world.tasks()) == 1
    assert [state for state, _ in world.history(1)].count(S.EXECUTING) == 1
    party.check()


def test_a_go_to_of_42_comes_as_an_item_only(make_world: MakeWorld) -> None:
    world = make_world()
    party = join(world, V42)
    armed(world, party)
    party.operator.go_to(*degrees(2, 0))
    world.until_state(1, S.COMPLETED, within=40)
    assert world.truth.north == pytest.approx(2.0, abs=0.5)  # its degrees are float32
    assert len(world.tasks()) == 1
    party.check()
