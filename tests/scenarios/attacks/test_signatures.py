"""S2, S3, S5: what is signed well and must not count, and what must count all the same.

A packet held back, one meant for another server, a clock that is ahead, a key that is revoked
while its task drives.
"""

from mav_tasks.engine.inputs import KeysChanged
from mav_tasks.mavlink.signing import timestamp_at
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, MOVE, FakeClient, command_long
from tests.kit.restarts import UTC
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_signing import ALICE, BOB, REVOKED, put, signing

HOUR, YEAR = 3600.0, 365 * 86_400.0


def at_time(client: FakeClient, utc: float) -> FakeClient:
    """Have a client's clock say this."""
    client.set_clock(timestamp_at(utc))
    return client


def held_back(world: World, client: FakeClient) -> bytes:
    """Return a TASK_MOVE that leaves the client now, and arrives when somebody wants it to."""
    client.heartbeats = False
    return client.packed(command_long(MOVE, 1.0, 0, 0, 0, 0, 0, 5))


# S2


def test_a_command_held_back_for_half_an_hour_is_not_done(world: World) -> None:
    put(world, ALICE)
    client = signing(world, ALICE)
    world.run(1.5)
    raw = held_back(world, client)
    world.leave(world.rover_parties[0])  # which would cost a minute of CPU
    world.run(1800.0)
    client.send_raw(raw)
    world.run(0.3)
    assert world.tasks() == ()


def test_a_command_for_one_server_is_not_done_by_another_a_minute_later(
    make_world: MakeWorld,
) -> None:
    """Who commands both has spoken to the other one before, too. Sooner than that nobody can tell
    for which of them it was: README of the dialect.
    """
    one, other = put(make_world(), ALICE), put(make_world(), ALICE)
    for world in (one, other):
        client = signing(world, ALICE)
        world.run(1.5)
    sent_at = other.now
    raw = held_back(one, signing(one, ALICE, name="mover"))
    client.heartbeats = False
    other.run(61.5)
    at_time(client, UTC + sent_at - 1.0)
    client.send_raw(raw)
    other.run(0.3)
    assert other.tasks() == ()


# S3


def ahead(world: World, seconds: float) -> FakeClient:
    """Have somebody with the key send from a clock that is ahead."""
    client = signing(world, ALICE, behind=-seconds, name="ahead")
    client.heartbeats = False
    client.move(1.0)
    client.rotate(5.0)
    world.run(0.5)
    return client


@for_each("seconds", [90.0, HOUR, YEAR])
def test_a_clock_ahead_shuts_nobody_out(world: World, seconds: float) -> None:
    put(world, ALICE, BOB)
    refused = ahead(world, seconds)
    assert (refused.acks, world.tasks(), world.paused()) == ([], (), R.NONE)
    same = signing(world, ALICE, name="the same stream")
    another = world.add_client("another stream")
    another.sign(ALICE.secret, utc=UTC + world.now, link_id=7)
    world.run(0.5)
    moved = same.move(1.0)
    world.run(0.5)
    stopped = another.stop()
    world.run(0.3)
    assert (moved.result, stopped.result) == (ACCEPTED, ACCEPTED)
    assert world.paused() is R.STOPPED


# S5


def test_a_task_of_a_revoked_key_drives_no_further(world: World) -> None:
    put(world, ALICE, BOB)
    client, operator = signing(world, ALICE), signing(world, BOB, name="operator")
    world.run(1.5)
    driven, waiting = client.move(20.0), client.move(1.0)
    world.until_state(1, S.EXECUTING)
    world.until(lambda: world.truth.north > 0.5, within=10)
    world.server.pump.handle(KeysChanged((REVOKED, BOB)), now=world.now)
    north = world.truth.north
    world.run(5.0)
    assert world.truth.north - north < 0.5
    assert world.stands()
    assert world.state(driven.task_id) == (S.PAUSED, R.OPERATOR)
    assert world.state(waiting.task_id)[0] is S.QUEUED
    told = (
        "Rover 1 is paused: key alice is no longer valid. Cancel its tasks 1, 2, or press Continue"
    )
    assert told in operator.texts()
    operator.proceed()
    world.until(lambda: world.state(driven.task_id)[0] is S.EXECUTING, within=10)
