"""The buttons of QGroundControl: each does what it says, once, and nothing pops up."""

from math import nan

import pytest

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, PX4, Mode, Persona
from tests.kit.cases import for_each
from tests.kit.px4 import PROMPT_PX4
from tests.kit.qgc.joined import (
    degrees,
    each_guided,
    each_make,
    each_pair,
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


class TestWhileDriving:
    @each_version
    @each_guided
    def test_pause_stops_it_and_an_action_goes_on(
        self, make_world: MakeWorld, persona: Persona, profile: Profile
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


class TestAlsoWhileDriving:
    @each_pair
    def test_the_mode_menu_is_obeyed(
        self, make_world: MakeWorld, persona: Persona, profile: Profile
    ) -> None:
        world = make_world(persona=persona)
        party = driving(world, profile)
        manual = {True: 0, False: 1 << 16}[persona is PROMPT]
        party.operator.set_mode(manual)
        active = world.now
        world.until(lambda: party.vehicle.state.mode == manual, within=1.3)
        assert world.now - active < 0.3, "the heartbeat comes at once"
        assert world.rover.autopilot.mode is Mode.MANUAL
        assert world.state(1) == (S.PAUSED, R.TAKEOVER)
        assert party.qgc.screen.complaints == []


@for_each("persona", [ARDUPILOT, PX4])
def test_a_mode_is_shown_at_once_also_of_a_rover_that_shows_it_once_a_second(
    make_world: MakeWorld, persona: Persona
) -> None:
    world = make_world(persona=persona)
    party = join(world, V4)
    manual = {True: 0, False: 1 << 16}[persona is ARDUPILOT]
    party.operator.set_mode({True: 4, False: 0x03040000}[persona is ARDUPILOT])
    world.run(2.1)
    world.until(lambda: party.vehicle.state.beat_at > world.now - 0.05, within=1.5)
    party.operator.set_mode(manual)
    world.until(lambda: party.vehicle.state.mode == manual, within=0.4)
    party.check()


@each_make
def test_emergency_stop_disarms_at_once(make_world: MakeWorld, persona: Persona) -> None:
    world = make_world(persona=persona)
    party = driving(world, V4)
    pressed = party.operator.emergency_stop()
    world.run(0.05)
    assert not world.rover.autopilot.armed
    assert pressed.result == 0
    world.run(4)
    assert world.stands()
    assert not world.rover.autopilot.armed
    assert "arm" in party.operator.offers
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


@each_make
def test_what_is_refused_is_shown_with_the_reason(make_world: MakeWorld, persona: Persona) -> None:
    world = make_world(persona=persona)
    party = join(world, V4)
    party.operator.action(MOVE, nan, component=191)
    world.run(0.5)
    assert [each.split(" ", 1)[1] for each in party.qgc.screen.complaints] == [
        f"MAV_CMD({MOVE}) command denied",
        "param1 distance is not given",  # the box on the map: the popup says no reason
    ]


@each_make
def test_arming_and_disarming(make_world: MakeWorld, persona: Persona) -> None:
    world = make_world(persona=persona)
    party = join(world, V4)
    for force in (False, True):
        party.operator.arm(force=force)
        world.run(1.5)
        assert world.rover.autopilot.armed
        party.operator.disarm()
        world.run(1.5)
        assert not world.rover.autopilot.armed
    party.check()


@each_make
def test_home_is_set(make_world: MakeWorld, persona: Persona) -> None:
    world = make_world(persona=persona)
    party = join(world, V4)
    party.operator.set_home(*degrees(30, 0), 584)
    world.run(2)
    party.check()
    assert party.vehicle.state.home is not None
    latitude, longitude = degrees(30, 0)
    assert party.vehicle.state.home[:2] == pytest.approx((latitude, longitude), abs=1e-5)


@each_make
def test_a_joystick_takes_the_rover_over(make_world: MakeWorld, persona: Persona) -> None:
    world = make_world(persona=persona)
    party = driving(world, V4)
    party.operator.sticks(0, 0, 0, 0)
    world.run(2)
    assert world.state(1)[0] is S.EXECUTING, "centred"
    party.operator.sticks(700, 0, 0, 0)
    world.run(2)
    party.operator.let_go()
    assert world.state(1) == (S.PAUSED, R.TAKEOVER)
    own = [text for text in party.popups if text.startswith("Failsafe: no offboard signal")]
    assert len(own) == (persona is not PROMPT), "a PX4 rover itself says so, and stands"
    assert party.popups == own
    assert party.qgc.screen.violations == []


# clicks on the map


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
