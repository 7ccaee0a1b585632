"""What is read later is not newer: the arrival of a packet counts, on whatever link it came.

Fault C1: a client's "continue" arrived before another client's STOP, but its link was read a
millisecond later. The STOP was acknowledged, and the rover drove on.
"""

from mav_tasks.engine.inputs import Packets
from mav_tasks.shell.in_memory import CLIENT_LINK
from mav_tasks.tasks.lifecycle import TaskReason as R
from rover_sim.personas import Mode
from tests.kit.cases import anew, for_each
from tests.kit.client import (
    ACCEPTED,
    ARM,
    AUTO,
    GUIDED,
    HOLD,
    PAUSE_CONTINUE,
    RTL,
    SET_MODE,
    TEMPORARILY_REJECTED,
    FakeClient,
    Message,
    command_long,
    set_mode,
)
from tests.kit.mission import Item
from tests.kit.world import World, at
from tests.scenarios.attacks.test_older_words import driven_since
from tests.scenarios.conftest import MakeWorld

SECOND = "server:second"
MISSION_START, WAYPOINT, STOP, CANCEL = 300, 16, 54003, 54010
MS = 0.001  # s

GO_WORDS = {
    "continue": command_long(PAUSE_CONTINUE, 1),
    "start": command_long(MISSION_START, target=(1, 1)),
    "AUTO": command_long(SET_MODE, 1, AUTO, target=(1, 1)),
    "RTL": command_long(SET_MODE, 1, RTL, target=(1, 1)),
    "GUIDED": command_long(SET_MODE, 1, GUIDED, target=(1, 1)),
    "SET_MODE": set_mode(GUIDED),
    "arm": command_long(ARM, 1, target=(1, 1)),
}
HALTS = {
    "STOP": command_long(STOP),
    "HOLD": command_long(SET_MODE, 1, HOLD, target=(1, 1)),
    "SET_MODE HOLD": set_mode(HOLD),
    "pause": command_long(PAUSE_CONTINUE, 0),
    "disarm": command_long(ARM, 0, target=(1, 1)),
}


@anew
def world(make_world: MakeWorld) -> World:
    """Return a world whose rover has driven the first metres of a mission, and is paused."""
    world = make_world(more_links=(SECOND,)).ready()
    plan = (Item(WAYPOINT, frame=0, current=1), Item(WAYPOINT, **at(12.0, 0.0)))
    world.upload(plan)
    world.client.send(GO_WORDS["start"])
    world.until_faster(0.3)
    world.client.pause()
    world.run(4)
    return world


def read(
    world: World, link: str, client: FakeClient, message: Message, *, arrived: float, at: float
) -> None:
    """Let the server read a packet of a link some time after it arrived."""
    world.run_until(lambda: world.now >= at, within=1.0)
    packets = Packets(link, [(client.name, client.packed(message))], [arrived])
    world.server.take_in(packets, now=world.now)


@for_each("halt", HALTS)
@for_each("word", GO_WORDS)
def test_an_older_word_of_another_link_undoes_no_halt(world: World, word: str, halt: str) -> None:
    person, script = world.add_client("person"), world.add_client("script", system_id=245)
    now = world.now
    is_armed = world.is_armed
    read(world, CLIENT_LINK, person, HALTS[halt], arrived=now + MS / 2, at=now + MS)
    read(world, SECOND, script, GO_WORDS[word], arrived=now, at=now + 3 * MS)
    assert driven_since(world, 4) < 0.001
    assert world.mode() is Mode.HOLD
    assert world.is_armed is (is_armed and halt != "disarm")
    assert (world.paused() is R.STOPPED) is (halt == "STOP")
    assert world.paused() is not R.NONE


@for_each("halt", HALTS)
def test_a_newer_word_of_another_link_counts_however_late_it_is_read(
    world: World, halt: str
) -> None:
    person, script = world.add_client("person"), world.add_client("script", system_id=245)
    now = world.now
    read(world, CLIENT_LINK, person, HALTS[halt], arrived=now, at=now + MS)
    world.run(2.0)  # a disarming counts until the rover has shown it
    now = world.now
    read(world, SECOND, script, GO_WORDS["continue"], arrived=now, at=now + 90 * MS)
    if halt == "STOP":  # which has ended the mission
        assert world.paused() is R.NONE
    else:
        assert driven_since(world, 6) > 1.0


def test_a_new_task_of_before_a_halt_is_refused_where_it_would_be_driven(world: World) -> None:
    """Nothing is paused after a cancel: what waits is driven."""
    person, script = world.add_client("person"), world.add_client("script", system_id=245)
    person.proceed()
    world.run(1.0)
    now = world.now
    read(world, CLIENT_LINK, person, command_long(CANCEL, 0), arrived=now + MS / 2, at=now + MS)
    move = command_long(54000, 5.0)
    read(world, SECOND, script, move, arrived=now, at=now + 3 * MS)
    world.run(2.0)
    assert script.acks_of(54000) == [(TEMPORARILY_REJECTED, R.STALE)]
    assert driven_since(world, 3) < 0.001
    script.move(1.0)
    world.run(0.5)
    assert script.acks_of(54000)[-1][0] == ACCEPTED
