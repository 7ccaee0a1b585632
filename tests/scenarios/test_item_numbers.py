"""The items of a mission have the numbers of its file everywhere: from 1, and home is 0."""

from mav_tasks.tasks.events import StepReached, TaskAdvanced
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, PX4, Persona
from tests.kit.cases import for_each
from tests.kit.mission import Item, Upload
from tests.kit.world import at
from tests.scenarios.conftest import MakeWorld

WAYPOINT, OPTIONS, START, SET_CURRENT = 16, 54014, 300, 224
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
    upload = Upload(world.client, [*before, NEAR, FAR], target=(1, component))
    world.until(lambda: upload.result is not None, within=5)
    assert upload.result != 0
    assert any("item 2 is 300.0 km away" in text for text in world.client.texts())


@for_each("persona, before, component", WAYS)
def test_status_and_log_count_as_the_file_does(
    make_world: MakeWorld, persona: Persona, before: list[Item], component: int
) -> None:
    world = make_world(persona=persona)
    upload = Upload(world.client, [*before, NEAR, NEXT, ABOUT], target=(1, component))
    world.until(lambda: upload.result == 0, within=5)
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
    advanced = {event.item for event in world.events(TaskAdvanced)}
    assert advanced <= {0, 1, 2}, "0: the end, past the last item"
    assert any("plan of 2 items" in each.text for each in world.client.statuses(1))


@for_each("persona", [ARDUPILOT, PX4])
@for_each("seq", [0, 1])
def test_without_a_mission_it_says_that_there_is_none(
    make_world: MakeWorld, persona: Persona, seq: int
) -> None:
    world = make_world(persona=persona)
    world.client.command(SET_CURRENT, seq, target=(1, 1))
    world.run(0.5)
    assert any("there is no mission: upload one first" in text for text in world.client.texts())
