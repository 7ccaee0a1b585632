"""A click on the map of QGroundControl, in all the forms in which it comes: one task, no popup."""

from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, Mode, Persona
from tests.kit.cases import for_each
from tests.kit.px4 import PROMPT_PX4
from tests.kit.qgc.joined import degrees, each_version, join
from tests.kit.qgc.party import QgcParty
from tests.kit.qgc.profile import MASTER, V4, Profile
from tests.kit.world import PROMPT, World, is_at
from tests.scenarios.conftest import MakeWorld


def armed(world: World, party: QgcParty) -> None:
    party.operator.arm()
    world.until(lambda: "go to" in party.operator.offers, within=3)


class TestGoTo:
    @each_version
    def test_of_px4_is_one_task(self, make_world: MakeWorld, profile: Profile) -> None:
        world = make_world(persona=PROMPT_PX4)
        party = join(world, profile)
        armed(world, party)
        party.operator.go_to(*degrees(2, 0))
        world.until_state(1, S.COMPLETED, within=40)
        assert is_at(world, 2.0, 0.0)
        assert len(world.tasks()) == 1
        party.check()


@for_each("persona, profile", [(PROMPT, V4), (ARDUPILOT, MASTER)])
@for_each("before", [Mode.MANUAL, Mode.HOLD, Mode.GUIDED])
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
