"""PX4's way to start a mission: the mode and arming, in either order."""

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import PX4, Mode, Persona
from tests.kit.cases import anew, for_each
from tests.kit.client import ACCEPTED, set_mode
from tests.kit.mission import Item
from tests.kit.px4 import HOLD, MISSION, PROMPT_PX4, ask_mode
from tests.kit.rows import check
from tests.kit.world import World, at, is_at
from tests.scenarios.conftest import MakeWorld

WAYPOINT, CANCEL, CLEAR = 16, 54010, 54011


@anew
def world(make_world: MakeWorld) -> World:
    """A rover at which a plan waits."""
    world = make_world(persona=PROMPT_PX4)
    upload = world.upload([Item(WAYPOINT, **at(1.0, 0.0)), Item(WAYPOINT, **at(2.0, 0.0))])
    assert (upload.result, upload.opaque_id) == (0, 1)
    return world


def waits_for_start(world: World) -> bool:
    status = world.shown(1)
    return (status.state, status.reason) == (S.BLOCKED, R.WAITING_FOR_START)


def shown(world: World) -> int:
    """The mode that the client was shown last."""
    beats = [
        m for p in world.client.of_id(0) if p.source == (1, 1) for m in [world.client.decoded(p)]
    ]
    return int(beats[-1].custom_mode)


def mark(world: World, by: str) -> None:
    if by == "SET_MODE":
        world.client.send(set_mode(MISSION))
        world.run(0.05)
    else:
        sent = ask_mode(world.client, MISSION)
        world.run(0.05)
        assert sent.answer == (ACCEPTED, 1)


@for_each("by", ["DO_SET_MODE", "SET_MODE"])
def test_the_mode_alone_marks_and_arming_starts(world: World, by: str) -> None:
    mark(world, by)
    assert shown(world) == MISSION, "at once"
    world.run(3)
    assert shown(world) == MISSION, "and as long as it is marked"
    assert waits_for_start(world)
    assert not world.is_armed
    world.client.arm()
    world.until_state(1, S.COMPLETED, within=40)
    assert is_at(world, 2.0, 0.0)
    assert shown(world) != MISSION


@for_each("by", ["DO_SET_MODE", "SET_MODE"])
def test_armed_before_the_mode_starts(world: World, by: str) -> None:
    world.client.arm()
    world.run(0.3)
    mark(world, by)
    assert world.state(1)[0] is S.STARTING
    world.run(0.1)
    assert shown(world) == MISSION
    world.run(2)
    assert shown(world) != MISSION, "the next plan can be uploaded"
    world.until_state(1, S.COMPLETED, within=40)


def test_armed_too_late_does_not_start(world: World) -> None:
    check(
        world,
        """
DO_SET_MODE 1 4 4 to=autopilot & wait 10.1 : ACCEPTED
ARM 1 & wait 2 : ACCEPTED
SHOW 1 : ACCEPTED status 1: BLOCKED WAITING_FOR_START
""",
    )
    assert shown(world) == HOLD


WISHES = """TASK_STOP & wait 1 & CONTINUE & wait 1 : ACCEPTED+ACCEPTED
PAUSE & wait 0.2 & CONTINUE & wait 1 : ACCEPTED+ACCEPTED
HOLD & wait 1 : ACCEPTED
DO_SET_MODE 1 1 to=autopilot & wait 1 : ACCEPTED
somebody> HOLD & wait 1 : ACCEPTED"""


@for_each("other", WISHES.splitlines())
def test_another_wish_removes_the_mark(world: World, other: str) -> None:
    somebody = world.add_client("somebody")
    mark = "DO_SET_MODE 1 4 4 to=autopilot & wait 1 : ACCEPTED"
    check(world, f"{mark}\n{other}", somebody=somebody)
    assert shown(world) != MISSION
    check(
        world,
        """
ARM 1 & wait 1.5 : ACCEPTED
SHOW 1 : ACCEPTED status 1: BLOCKED WAITING_FOR_START
""",
    )


@for_each("call_off", [(CANCEL, 1), (CANCEL, 1, 1), (CLEAR,), (CLEAR, 1)])
def test_a_mission_that_was_called_off_does_not_start(
    world: World, call_off: tuple[int, ...]
) -> None:
    ask_mode(world.client, MISSION)
    world.run(0.3)
    sent = world.client.command(*call_off)
    world.run(0.3)
    assert sent.result == ACCEPTED
    world.client.arm()
    world.run(4)
    assert abs(world.truth.north) < 0.05
    assert len(world.tasks()) == 1, "nor does another task of it"


@for_each("persona", [PX4, PROMPT_PX4])
def test_a_person_who_arms_to_drive_by_hand_keeps_the_rover(
    make_world: MakeWorld, persona: Persona
) -> None:
    world = make_world(persona=persona)
    world.upload([Item(WAYPOINT, **at(1.0, 0.0))])
    world.operator_mode(Mode.MANUAL)
    world.run(1.5)
    ask_mode(world.client, MISSION)
    world.run(2)
    world.operator_arm(True)
    world.run(4)
    assert world.mode() is Mode.MANUAL
    assert world.stands()
