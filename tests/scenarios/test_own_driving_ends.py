"""A client's own stop, HOLD, return, "go to" or mission ends what it drives by setpoints.

So do the end of the server, and that of the client's right to drive.
"""

from collections.abc import Callable

from mav_tasks.config.settings import Roles, Settings
from mav_tasks.engine.inputs import SettingsChanged
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, Persona
from tests.kit.cases import for_each
from tests.kit.client import (
    ACCEPTED,
    AUTO,
    GUIDED,
    RTL,
    FakeClient,
    Sent,
    setpoint,
)
from tests.kit.client import HOLD as AP_HOLD
from tests.kit.px4 import HOLD, MISSION, OFFBOARD, PROMPT_PX4, REPOSITION, RETURN, ask_mode
from tests.kit.rows import check
from tests.kit.world import World, at
from tests.scenarios.conftest import MakeWorld

AT_ONCE = 0.25  # s, two steps of the clock and the commit
NO_LONGER = 2.0  # s after a client's last setpoint, in which tasks waited for it
CRITICAL = 2  # MAV_SEVERITY

AP, PX = ARDUPILOT, PROMPT_PX4


def drives(make_world: MakeWorld, persona: Persona) -> World:
    """A rover that a client drives by its setpoints, 20 a second, which go on."""
    world = make_world(persona=persona)
    world.client.arm()
    world.run(1.2)
    world.client.stream(setpoint(0.6), rate=20)
    world.run(0.3)
    ask(world.client, persona, "drive")
    world.run(2.5)
    assert world.truth.forward_speed > 0.4
    return world


def ask(client: FakeClient, persona: Persona, what: str) -> Sent:
    """Ask for a mode by its meaning."""
    if persona is AP:
        modes = {"drive": GUIDED, "hold": AP_HOLD, "return": RTL, "mission": AUTO}
        return client.mode(modes[what])
    modes = {"drive": OFFBOARD, "hold": HOLD, "return": RETURN, "mission": MISSION}
    return ask_mode(client, modes[what])


@for_each("persona", [AP, PX])
@for_each("first", ["", "hold"])
def test_a_return_is_taken_at_once_and_ends_the_clients_setpoints(
    make_world: MakeWorld, persona: Persona, first: str
) -> None:
    world = drives(make_world, persona)
    far = world.truth.north
    if first:
        assert ask(world.client, persona, first)
        world.run(0.1)
    sent = ask(world.client, persona, "return")
    world.run(AT_ONCE)
    assert sent.result == ACCEPTED
    world.run(1.0)
    assert world.truth.forward_speed < 0.1, "the stream goes on, and does not pass"
    world.until_state(sent.task_id, S.COMPLETED, within=30)
    assert abs(world.truth.north) < 0.2 < far


@for_each("persona", [AP, PX])
def test_a_go_to_begins_at_once_and_without_a_failsafe(
    make_world: MakeWorld, persona: Persona
) -> None:
    world = drives(make_world, persona)
    world.client.end_streams()
    sent = world.client.command_int(REPOSITION, -1, 1, 0, 0, **at(6.0, 0.0), frame=6, target=(1, 1))
    asked_at = world.now
    world.run(AT_ONCE)
    assert world.state(sent.task_id)[0] is S.STARTING
    world.until_state(sent.task_id, S.EXECUTING, within=NO_LONGER + 1.5)
    world.until_state(sent.task_id, S.COMPLETED, within=30)
    severities = {t.severity for t in world.client.of_type("STATUSTEXT")}
    assert min(severities, default=6) > CRITICAL, world.client.texts()
    assert world.now > asked_at


def test_a_queue_that_is_cleared_leaves_no_velocity_of_the_clients_behind(
    make_world: MakeWorld,
) -> None:
    world = drives(make_world, AP)
    check(world, "TASK_CLEAR 1 & wait 1.5 : ACCEPTED it STANDS / mode hold")


def end_of_server(world: World) -> None:
    assert set(world.last_words()) == {"zero", "HOLD"}, "also if its engine fails"
    world.server.shut_down(now=world.now)


def end_of_right(world: World) -> None:
    settings = Settings(roles=Roles(unsigned="submitter"))
    world.server.pump.handle(SettingsChanged(settings), now=world.now)


@for_each("persona", [AP, PX])
@for_each("end", [end_of_server, end_of_right])
def test_the_end_of_the_server_or_of_its_right_stops_what_a_client_drives(
    make_world: MakeWorld, persona: Persona, end: Callable[[World], None]
) -> None:
    world = drives(make_world, persona)
    before = world.truth.north
    end(world)
    world.run(2.0)
    assert world.stands()
    assert world.truth.north - before < 0.6, "it does not roll until its own time-out"
