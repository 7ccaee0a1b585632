"""After each halt a person at QGroundControl finds the way on; what drives is on the screen."""

import pytest

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode, Persona
from tests.kit.cases import for_each
from tests.kit.px4 import PROMPT_PX4
from tests.kit.qgc.joined import degrees, join, place
from tests.kit.qgc.party import QgcParty
from tests.kit.qgc.plan_master import Plan
from tests.kit.qgc.profile import V4
from tests.kit.qgc.vehicle import APM
from tests.kit.world import PROMPT, World, is_at
from tests.scenarios.conftest import MakeWorld

PAUSE_CONTINUE, STOP = 193, 54003
WARNING = 4  # this severity and smaller ones are red
FAR = degrees(20, 0)
ROUND = Plan(place(0, 0), [place(3, 0), place(3, 1)])

both = for_each("persona", [PROMPT, PROMPT_PX4])


def texts(party: QgcParty, *, since: float, worst: int = WARNING) -> list[str]:
    """Return the texts that were shown in red since then, also those of the autopilot."""
    shown = party.qgc.screen.texts
    return [each.text for each, severity in shown if each.at >= since and severity <= worst]


def arm(world: World, party: QgcParty) -> None:
    party.operator.arm()
    world.until(lambda: "go to" in party.operator.offers, within=3)


def choose(world: World, party: QgcParty, mode: Mode) -> None:
    """Choose a mode in the menu."""
    numbers = (PROMPT if party.vehicle.state.firmware == APM else PROMPT_PX4).modes.numbers
    party.operator.set_mode(numbers[mode])
    world.run(1.5)


def joined(
    make_world: MakeWorld, persona: Persona, plan: Plan | None = None
) -> tuple[World, QgcParty]:
    """Have a person at QGroundControl, who has uploaded a plan."""
    world = make_world(persona=persona)
    party = join(world, V4)
    if plan is not None:
        party.plans.upload(plan)
        world.until(lambda: party.plans.is_done, within=5)
    return world, party


def driving_far(make_world: MakeWorld, persona: Persona) -> tuple[World, QgcParty]:
    """Have the rover on its way to a place that the person has clicked."""
    world, party = joined(make_world, persona)
    arm(world, party)
    party.operator.go_to(*FAR)
    world.until(lambda: world.truth.north > 0.5, within=20)
    return world, party


def driving_plan(make_world: MakeWorld, persona: Persona) -> tuple[World, QgcParty]:
    """Have the rover on its way in a plan."""
    world, party = joined(make_world, persona, ROUND)
    party.operator.start()
    world.until(lambda: world.truth.north > 0.5, within=25)
    return world, party


@both
def test_an_emergency_stop_ends_a_go_to_and_the_next_click_drives(
    make_world: MakeWorld, persona: Persona
) -> None:
    world, party = driving_far(make_world, persona)
    at = world.now
    party.operator.emergency_stop()
    world.run(5)
    assert world.state(1) == (S.KILLED, R.STOP)
    assert world.mode() is Mode.HOLD
    assert texts(party, since=at) == []
    assert [text for text in texts(party, since=at, worst=6) if "Task" in text] == [
        "Task 1 stopped for good by a ground station"
    ]
    arm(world, party)
    stood = world.truth.north
    world.run(4)
    assert world.truth.north == pytest.approx(stood, abs=0.05), "arming alone moves nothing"
    party.operator.go_to(*degrees(0, 1))
    party.operator.action(PAUSE_CONTINUE, 1)
    world.until_state(2, S.COMPLETED, within=40)
    assert is_at(world, 0.0, 1.0)
    party.check()


@both
@for_each("button", ["emergency stop", "disarm"])
def test_a_plan_goes_on_by_the_station_own_button(
    make_world: MakeWorld, persona: Persona, button: str
) -> None:
    world, party = driving_plan(make_world, persona)
    at = world.now
    party.operator.emergency_stop() if button == "emergency stop" else party.operator.disarm()
    world.run(4)
    assert world.state(1) == (S.PAUSED, R.OPERATOR)
    assert texts(party, since=at) == []
    arm(world, party)
    party.operator.go_on()
    world.until_state(1, S.COMPLETED, within=60)
    assert len(world.tasks()) == 1
    party.check()


@both
@for_each("taken", ["hold", "manual at the rover"])
def test_hold_and_a_click_replace_the_click_before(
    make_world: MakeWorld, persona: Persona, taken: str
) -> None:
    """Also without the actions for tasks: two things that every station has."""
    world, party = driving_far(make_world, persona)
    if taken == "manual at the rover":
        world.operator_mode(Mode.MANUAL)
        world.run(4)
        party.operator.go_to(*degrees(0, 3))
        world.run(2)
        assert world.state(2)[0] is S.QUEUED, "the person at the rover has it"
        told = texts(party, since=0.0, worst=6)
        assert any("press Continue, or set Hold and click again" in text for text in told)
    choose(world, party, Mode.HOLD)
    world.run(2)
    party.operator.go_to(*degrees(0, 1))
    task = len(world.tasks()) + 1
    world.until_state(task, S.COMPLETED, within=40)
    assert is_at(world, 0.0, 1.0)
    assert {world.state(each) for each in range(1, task)} == {(S.CANCELLED, R.REPLACED)}
    assert world.paused() is R.NONE
    party.check()
