"""The buttons of QGroundControl: each does what it says, once, and nothing pops up."""

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, Mode, Persona
from tests.kit.cases import for_each
from tests.kit.px4 import PROMPT_PX4
from tests.kit.qgc.joined import (
    degrees,
    each_guided,
    each_make,
    each_version,
    join,
    slowest_ack,
)
from tests.kit.qgc.party import QgcParty
from tests.kit.qgc.profile import MASTER, V4, Profile
from tests.kit.world import PROMPT, World, is_at
from tests.scenarios.conftest import MakeWorld

PAUSE_CONTINUE, STOP, MOVE, DRIVE = 193, 54003, 54000, 54002


def driving(world: World, profile: Profile) -> QgcParty:
    """Have the rover on its way, by a press of an action for a long move."""
    party = join(world, profile)
    party.operator.action(MOVE, 9.0, component=191)
    world.until(lambda: world.truth.north > 0.5, within=20)
    world.run(1.1)  # a heartbeat, and EXTENDED_SYS_STATE
    return party


@each_version
@each_guided
def test_pause_stops_what_drives_and_an_action_goes_on(
    make_world: MakeWorld, persona: Persona, profile: Profile
) -> None:
    world = make_world(persona=persona)
    party = driving(world, profile)
    if persona is PROMPT:  # its button shows a popup in every version and sends nothing
        party.operator.pause_all()
    else:
        party.operator.pause()
    world.run(3)
    assert world.stands()
    assert world.state(1) == (S.PAUSED, R.OPERATOR)
    party.operator.action(PAUSE_CONTINUE, 1)
    north = world.truth.north
    world.until(lambda: world.truth.north > north + 0.5, within=10)
    assert len(world.tasks()) == 1
    assert party.qgc.screen.complaints == []


@each_version
@each_make
def test_actions_are_acknowledged_in_time_from_whom_they_were_sent_to(
    make_world: MakeWorld, persona: Persona, profile: Profile
) -> None:
    world = make_world(persona=persona)
    party = join(world, profile)
    pressed = []
    for component in (1, 191):
        pressed.append(party.operator.action(MOVE, 0.2, component=component))
        pressed.append(party.operator.action(DRIVE, 0.2, 0, 1, component=component))
        pressed.append(party.operator.action(PAUSE_CONTINUE, 0, component=component))
        world.run(0.2)
        pressed.append(party.operator.action(PAUSE_CONTINUE, 1, component=component))
        world.run(3)
    pressed.append(party.operator.action(STOP, 1, component=191))
    world.run(1)
    pressed.append(party.operator.action(PAUSE_CONTINUE, 1, component=191))
    world.run(1)
    assert [each.result for each in pressed] == [0] * len(pressed)
    assert slowest_ack(party) < 0.6
    assert party.qgc.screen.complaints == []


@for_each("persona, profile", [(PROMPT, V4), (ARDUPILOT, MASTER), (PROMPT_PX4, V4)])
@for_each("before", [Mode.MANUAL, Mode.HOLD, Mode.GUIDED])
def test_a_go_to_in_all_its_forms_is_one_task(
    make_world: MakeWorld, persona: Persona, profile: Profile, before: Mode
) -> None:
    """ArduPilot's: a command and an item; from another mode a change of mode between the two."""
    world = make_world(persona=persona)
    party = join(world, profile)
    if persona is not PROMPT_PX4 or before is not Mode.GUIDED:  # there it cannot be armed
        party.operator.set_mode(persona.modes.numbers[before])
    world.run(1.2)
    party.operator.arm()
    world.run(1.2)
    party.operator.go_to(*degrees(2, 0))
    world.until_state(1, S.COMPLETED, within=40)
    world.run(3)
    assert is_at(world, 2.0, 0.0)
    assert len(world.tasks()) == 1
    assert [state for state, _ in world.history(1)].count(S.EXECUTING) == 1
    party.check()
