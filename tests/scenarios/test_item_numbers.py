"""The items of a mission have the numbers of its file everywhere: from 1, and home is 0."""

from mav_tasks.tasks.events import StepReached
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, PX4, Persona
from tests.kit.cases import for_each
from tests.kit.mission import Item
from tests.kit.world import at
from tests.scenarios.conftest import MakeWorld

WAYPOINT, OPTIONS, START = 16, 54014, 300
HOME = Item(WAYPOINT, frame=0, current=1)
NEAR, NEXT, FAR = (Item(WAYPOINT, **at(north, 0.0)) for north in (1.0, 2.0, 300_000.0))
ABOUT = Item(OPTIONS, frame=2, param1=5)

#: each way to upload the same file: what comes before its items, to which component
WAYS = [
    (ARDUPILOT, [HOME], 1),
    (PX4, [], 1),
    (ARDUPILOT, [], 191),
]


@for_each("persona, before, component", WAYS)
def test_a_refusal_names_the_row_of_the_file(
    make_world: MakeWorld, persona: Persona, before: list[Item], component: int
) -> None:
    world = make_world(persona=persona)
    upload = world.upload([*before, NEAR, FAR], target=(1, component))
    assert upload.result != 0
    assert world.client.said("item 2 is 300.0 km away")


@for_each("persona, before, component", WAYS)
def test_status_and_log_count_as_the_file_does(
    make_world: MakeWorld, persona: Persona, before: list[Item], component: int
) -> None:
    world = make_world(persona=persona)
    assert world.upload([*before, NEAR, NEXT, ABOUT], target=(1, component)).result == 0
    if component == 1:
        world.client.command(START, target=(1, 1))
    seen: set[tuple[int, int]] = set()
    while world.state(1)[0] is not S.COMPLETED:
        world.client.request_status(1)
        world.run(0.5)
        seen |= {(each.step + 1, each.step_count) for each in world.client.statuses(1)}
    assert seen == {(1, 2), (2, 2)}
    reached = [str(event) for event in world.events(StepReached)]
    assert reached == ["rover 1: task 1: item 1 reached", "rover 1: task 1: item 2 reached"]
    assert any("plan of 2 items" in each.text for each in world.client.statuses(1))
