"""What the holder of a key may do, within its own limits: decided by the server, by the content."""

from collections.abc import Callable
from math import hypot
from pathlib import Path

import pytest

from mav_tasks.config.settings import Limits
from mav_tasks.engine.inputs import KeysChanged, LinkChanged, LinkSide, WallClock
from mav_tasks.mavlink.signing import Key
from mav_tasks.shell.in_memory import CLIENT_LINK
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.geo import DEFAULT_ORIGIN
from tests.kit.cases import anew, for_each
from tests.kit.client import (
    ACCEPTED,
    DENIED,
    GUIDED,
    RTL,
    FakeClient,
    Sent,
    setpoint,
    sticks,
)
from tests.kit.mission import Item, Upload
from tests.kit.restarts import UTC, restart
from tests.kit.rows import ask, check
from tests.kit.store import PromptSqliteStore
from tests.kit.world import World, at, put_home
from tests.scenarios.conftest import MakeWorld

WAYPOINT, OPTIONS, SPEED, RETURN = 16, 54014, 178, 20
REPOSITION, MODIFY, CANCEL = 192, 54012, 54010
PRIORITY = 1  # TASK_MODIFY, param2
BOSS = Key("boss", bytes(range(32)), "operator")
SECRET = bytes(range(1, 33))
NOT_ALLOWED = (DENIED, R.NOT_ALLOWED)
MISSION_ACCEPTED = 0


def agents(limits: Limits | None = None, *, role: str = "submitter", secret: bytes = SECRET) -> Key:
    return Key("agent", secret, role, limits=limits)


def put(world: World, *keys: Key) -> None:
    """Hand a server its keys, as the watch of the key ring does."""
    world.server.pump.handle(KeysChanged(keys), now=world.now)
    world.server.pump.turn(now=world.now)


def opened(world: World, *keys: Key) -> World:
    server, now = world.server, world.now
    server.pump.handle(WallClock(UTC), now=now)
    for up in (False, True):
        change = LinkChanged(CLIENT_LINK, LinkSide.CLIENTS, up=up, takes_unsigned=True)
        server.pump.handle(change, now=now)
    put(world, *keys)
    return world


def signing(world: World, key: Key, *, name: str = "agent", system_id: int = 77) -> FakeClient:
    client = world.add_client(name, system_id=system_id)
    client.sign(key.secret, utc=UTC + world.now)
    world.run(1.2)
    return client


@anew
def limited(world: World) -> Callable[..., FakeClient]:
    """Return a factory of a client whose key has these limits; BOSS is an operator's key."""

    def make(role: str = "submitter", **limits: object) -> FakeClient:
        key = agents(Limits(**limits), role=role)  # type: ignore[arg-type]
        return signing(opened(world, BOSS, key), key)

    return make


def answer(world: World, sent: Sent) -> tuple[int, int] | None:
    world.run(0.3)
    return sent.answer


def uploaded(world: World, client: FakeClient, *items: Item) -> Upload:
    return world.upload(items, target=(1, 191), client=client)


def places(*norths: float) -> list[Item]:
    found = (DEFAULT_ORIGIN.to_global(north, 0.0) for north in norths)
    return [Item(WAYPOINT, x, y, param1=0.01, param4=0.0) for x, y in found]


def of_ours(command: int, *params: float) -> Item:
    p1, p2, p3, p4 = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return Item(command, 0, 0, p1, p2, p3, p4, frame=2)


def way(world: World, tasks: int) -> tuple[float, float]:
    """Run until the tasks are over; return the true way of the rover, and its top speed."""
    metres, fastest, before = 0.0, 0.0, world.pose()
    end = world.now + 120.0
    while not world.is_idle(tasks=tasks) and world.now < end:
        world.run(0.1)
        here = world.pose()
        step = hypot(here[0] - before[0], here[1] - before[1])
        metres, fastest, before = metres + step, max(fastest, step / 0.1), here
    return metres, fastest


# speed


def test_a_higher_speed_is_refused_in_words(
    world: World, limited: Callable[..., FakeClient]
) -> None:
    world.client = agent = limited(max_speed=0.1)
    check(
        world,
        """
TASK_MOVE 1 0.2 0 0 0 0 5 & wait 1.2 : DENIED key agent may drive 0.1 m/s at most, not 0.2
TASK_DRIVE -0.2 0 1 & wait 1.2 : DENIED
DO_REPOSITION 0.2 0 to=autopilot frame=6 at=1,0 & wait 1.2 : DENIED
plan; DO_CHANGE_SPEED 1 0.2 0 0 frame=2; GO 0.01 0 0 0 at=1,0 & wait 1.2 : DENIED
""",
    )
    assert {(ack.result, ack.result_param2) for ack in agent.acks} == {NOT_ALLOWED}
    assert world.tasks() == ()


def test_the_tighter_limit_counts_and_an_operators_key_has_limits_too(
    world: World, limited: Callable[..., FakeClient]
) -> None:
    agent = limited("operator", max_speed=0.1, max_priority=6)
    assert answer(world, agent.move(1.0, speed=0.2)) == NOT_ALLOWED
    assert answer(world, agent.command(SPEED, 1, 0.2)) == (DENIED, R.BAD_PARAMETER)
    assert answer(world, agent.move(1.0, priority=7)) == NOT_ALLOWED
    assert answer(world, agent.move(5.0, priority=6)) == (ACCEPTED, 1)
    assert answer(world, agent.command(MODIFY, 1, PRIORITY, 7)) == NOT_ALLOWED


# distance


def go_to(world: World, agent: FakeClient, north: float) -> None:
    agent.command_int(REPOSITION, -1, 0, target=(1, 1), frame=6, **at(north, 0))
    world.run(0.3)


#: from 0, 0, heading north; within 3 m
WITHIN = """
TASK_MOVE 3 0 0 0 0 0 5
TASK_DRIVE 0.5 0 6
DO_REPOSITION -1 0 to=autopilot frame=6 at=2.9,0
plan; NAV_WAYPOINT 0.01 0 0 0 at=1.45,0; NAV_WAYPOINT 0.01 0 0 0 at=0,0
plan; TASK_MOVE 1 0 0 0 frame=2; DO_JUMP 0 2 0 0 frame=2
plan to=any; NAV_WAYPOINT 0.01 0 0 0 at=1.49,0; NAV_WAYPOINT 0.01 0 0 0 at=0,0
"""
BEYOND = """
TASK_MOVE 3.1 0 0 0 0 0 5 : DENIED
TASK_MOVE -3.1 0 0 0 0 0 5 : DENIED
TASK_DRIVE -0.5 0 6.5 : DENIED
DO_REPOSITION -1 0 to=autopilot frame=6 at=3.1,0 : DENIED
plan; GO 0.01 0 0 0 at=1.6,0; GO 0.01 0 0 0 at=0,0 & wait 1 : DENIED
plan; TASK_MOVE 1 0 0 0 frame=2; TASK_MOVE -2.1 0 0 0 frame=2 & wait 1 : DENIED
plan; TASK_MOVE 1 0 0 0 frame=2; DO_JUMP 0 3 0 0 frame=2 & wait 1 : DENIED
plan; TASK_MOVE 0.01 0 0 0 frame=2; DO_JUMP 0 -1 0 0 frame=2 & wait 1 : DENIED
mission; GO 0.01 0 0 0 at=0,0; GO 0.01 0 0 0 at=1.6,0; GO 0.01 0 0 0 at=0,0 & wait 1 : DENIED
plan to=any; GO 0.01 0 0 0 at=1.6,0; GO 0.01 0 0 0 at=0,0 & wait 1 : DENIED
TASK_MOVE 3.1 0 0 0 0 0 5 to=any : DENIED
"""


@for_each("what", WITHIN.strip().split("\n"))
def test_a_way_within_the_limit_is_driven(
    world: World, limited: Callable[..., FakeClient], what: str
) -> None:
    world.client = limited(max_distance=3.0)
    ask(world, what)
    world.run(0.3)
    metres, _ = way(world, 1)
    assert world.state(1)[0] is S.COMPLETED
    assert metres == pytest.approx(3.0, abs=0.2)


def test_a_longer_way_is_refused_in_words(world: World, limited: Callable[..., FakeClient]) -> None:
    world.client = agent = limited(max_distance=3.0)
    check(world, BEYOND)
    assert {(ack.result, ack.result_param2) for ack in agent.acks} == {NOT_ALLOWED}
    assert agent.said("key agent may drive 3 m at most in a task")
    world.run(5.0)
    assert world.tasks() == ()
    assert world.pose() == pytest.approx((0.0, 0.0, 0.0), abs=0.05)


def test_a_return_is_as_long_as_the_way_home(
    world: World, limited: Callable[..., FakeClient]
) -> None:
    put_home(world, 0.0, 0.0)
    agent, boss = limited(max_distance=3.0), signing(world, BOSS, name="boss")
    boss.move(4.0)
    world.run(0.3)
    way(world, 1)
    assert answer(world, agent.mode(RTL)) == NOT_ALLOWED
    assert answer(world, agent.command(RETURN, target=(1, 1))) == NOT_ALLOWED
    boss.move(-2.0)
    world.run(0.3)
    way(world, 2)
    assert answer(world, agent.command(RETURN, target=(1, 1))) == (ACCEPTED, 3)


def test_a_way_begins_where_the_tasks_before_it_end(
    world: World, limited: Callable[..., FakeClient]
) -> None:
    agent, boss = limited(max_distance=3.0), signing(world, BOSS, name="boss")
    assert answer(world, boss.move(6.0)) == (ACCEPTED, 1)
    go_to(world, agent, 1.0)
    assert len(world.tasks()) == 1  # 5 m back, by its turn
    go_to(world, agent, 8.0)
    way(world, 2)
    assert world.state(2)[0] is S.COMPLETED
    assert world.pose()[0] == pytest.approx(8.0, abs=0.1)


def test_a_task_that_would_begin_too_far_away_fails_where_the_rover_stands(
    world: World, limited: Callable[..., FakeClient]
) -> None:
    agent, boss = limited(max_distance=3.0), signing(world, BOSS, name="boss")
    upload = uploaded(world, agent, *places(2.0), of_ours(OPTIONS, 5, 20))
    assert (upload.result, world.state(1)[0]) == (MISSION_ACCEPTED, S.SCHEDULED)
    boss.move(-4.0)
    world.run(15.0)
    assert world.stands()
    world.until_state(1, S.FAILED, within=20)
    assert world.state(1) == (S.FAILED, R.NOT_ALLOWED)
    assert agent.said("task 1 may drive 3 m: its way is 6.0 m")
    assert world.pose()[0] == pytest.approx(-4.0, abs=0.1)


@for_each("limits", [{"max_speed": 0.5}, {"max_distance": 3.0}])
def test_a_bounded_key_drives_by_tasks_alone(
    world: World, limited: Callable[..., FakeClient], limits: dict[str, float]
) -> None:
    world.client = agent = limited("safety", **limits)
    check(
        world,
        """
COMPONENT_ARM_DISARM 1 to=autopilot : DENIED its limits of speed or way allow only tasks
DO_SET_MODE 1 15 to=autopilot : DENIED
DO_SET_MODE 1 0 to=autopilot : DENIED
DO_SET_SERVO 1 1500 to=autopilot : DENIED
DO_CHANGE_SPEED 1 2 to=camera : DENIED
plan; GO 0.01 0 0 0 at=1,0; DO_SET_RELAY 0 1 0 0 frame=2 & wait 1 : DENIED
""",
    )
    assert {(ack.result, ack.result_param2) for ack in agent.acks} == {NOT_ALLOWED}
    agent.stream(setpoint(1.0), rate=20)
    agent.stream(sticks(x=900), rate=20)
    boss = signing(world, BOSS, name="boss")
    boss.mode(GUIDED)
    boss.arm()
    world.run(5.0)
    assert world.pose() == pytest.approx((0.0, 0.0, 0.0), abs=0.05)
    assert answer(world, agent.stop()) == (ACCEPTED, 0)
    assert answer(world, agent.proceed()) == (ACCEPTED, 0)


# owners and nonces


def test_a_name_that_is_given_again_does_not_own_the_tasks_of_the_old_key(
    make_world: MakeWorld, path: Path
) -> None:
    world, key, again = (
        make_world(store=PromptSqliteStore(path, wall_offset=UTC)),
        agents(),
        agents(secret=bytes(range(2, 34))),
    )
    old, boss = signing(opened(world, BOSS, key), key), signing(world, BOSS, name="boss")
    assert answer(world, boss.move(20.0)) == (ACCEPTED, 1)
    assert answer(world, old.move(1.0)) == (ACCEPTED, 2)
    assert answer(world, old.move(1.0, nonce=7)) == (ACCEPTED, 3)
    put(world, BOSS, again)
    new = signing(world, again, name="new")
    assert answer(world, new.command(CANCEL, 2)) == NOT_ALLOWED
    assert new.said("task 2 belongs to")
    assert answer(world, new.move(1.0, nonce=7)) == (ACCEPTED, 4)
    restart(world, path, away=0.0, settles=0.0)
    opened(world, BOSS, again, Key("first", SECRET, "submitter"))
    new, first = signing(world, again, name="newer"), signing(world, key, name="first")
    assert answer(world, new.command(CANCEL, 2)) == NOT_ALLOWED
    assert answer(world, first.move(1.0, nonce=7)) == (ACCEPTED, 3)
    assert answer(world, first.command(CANCEL, 2)) == (ACCEPTED, 2)


def test_a_nonce_belongs_to_its_key(world: World, limited: Callable[..., FakeClient]) -> None:
    agent = limited(max_speed=0.1, max_distance=1.0)
    boss = signing(world, BOSS, name="boss", system_id=77)  # the same address
    assert answer(world, boss.move(12.0, speed=1.6, nonce=4711)) == (ACCEPTED, 1)
    assert answer(world, agent.move(12.0, speed=1.6, nonce=4711)) == NOT_ALLOWED
    assert answer(world, agent.move(1.0, nonce=4711)) == (ACCEPTED, 2)
    assert answer(world, agent.move(1.0, nonce=4711)) == (ACCEPTED, 2)
