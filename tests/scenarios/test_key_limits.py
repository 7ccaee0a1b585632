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
from tests.kit.cases import anew, for_each
from tests.kit.client import (
    ACCEPTED,
    DENIED,
    GUIDED,
    FakeClient,
    Sent,
    setpoint,
    sticks,
)
from tests.kit.restarts import UTC, restart
from tests.kit.rows import ask, check
from tests.kit.store import PromptSqliteStore
from tests.kit.world import World, put_home
from tests.scenarios.conftest import MakeWorld

BOSS = Key("boss", bytes(range(32)), "operator")
SECRET = bytes(range(1, 33))
NOT_ALLOWED = (DENIED, R.NOT_ALLOWED)


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
    world.client = limited("operator", max_speed=0.1, max_priority=6)
    check(
        world,
        f"""
TASK_MOVE 1 0.2 0 0 0 0 5 : NOT_ALLOWED
DO_CHANGE_SPEED 1 0.2 : DENIED #{R.BAD_PARAMETER}
TASK_MOVE 1 0 0 0 0 0 7 : NOT_ALLOWED
TASK_MOVE 5 0 0 0 0 0 6 : ACCEPTED #1
TASK_MODIFY 1 1 7 : NOT_ALLOWED
""",
    )


# distance


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
    world.client = limited(max_distance=3.0)
    check(
        world,
        """
boss> TASK_MOVE 4 & idle 1 : ACCEPTED
DO_SET_MODE 1 11 to=autopilot : NOT_ALLOWED
NAV_RETURN_TO_LAUNCH to=autopilot : NOT_ALLOWED
boss> TASK_MOVE -2 & idle 2 : ACCEPTED
NAV_RETURN_TO_LAUNCH to=autopilot : ACCEPTED #3
""",
        boss=signing(world, BOSS, name="boss"),
    )


def test_a_way_begins_where_the_tasks_before_it_end(
    world: World, limited: Callable[..., FakeClient]
) -> None:
    world.client = limited(max_distance=3.0)  # the first would be 5 m back, by its turn
    check(
        world,
        """
boss> TASK_MOVE 6 : ACCEPTED #1
DO_REPOSITION -1 0 to=autopilot frame=6 at=1,0 : NOT_ALLOWED
DO_REPOSITION -1 0 to=autopilot frame=6 at=8,0 & idle 2 : ACCEPTED #2 / task 2: COMPLETED
""",
        boss=signing(world, BOSS, name="boss"),
    )
    assert world.pose()[0] == pytest.approx(8.0, abs=0.1)


def test_a_task_that_would_begin_too_far_away_fails_where_the_rover_stands(
    world: World, limited: Callable[..., FakeClient]
) -> None:
    world.client = limited(max_distance=3.0)
    check(
        world,
        """
plan; GO 0.01 0 0 0 at=2,0; TASK_OPTIONS 5 20 0 0 frame=2 & wait 1 : ACCEPTED task 1: SCHEDULED
boss> TASK_MOVE -4 & wait 15 : ACCEPTED it STANDS
until 1 FAILED : - task 1: FAILED NOT_ALLOW / task 1 may drive 3 m: its way is 6.0 m
""",
        boss=signing(world, BOSS, name="boss"),
    )
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
    key, again = agents(), agents(secret=bytes(range(2, 34)))
    world = opened(make_world(store=PromptSqliteStore(path, wall_offset=UTC)), BOSS, key)
    check(
        world,
        """
boss> TASK_MOVE 20 : ACCEPTED #1
old> TASK_MOVE 1 0 0 0 0 0 5 : ACCEPTED #2
old> TASK_MOVE 1 0 0 7 0 0 5 : ACCEPTED #3
""",
        old=signing(world, key),
        boss=signing(world, BOSS, name="boss"),
    )
    put(world, BOSS, again)
    check(
        world,
        """
new> TASK_CANCEL 2 : NOT_ALLOWED / task 2 belongs to
new> TASK_MOVE 1 0 0 7 0 0 5 : ACCEPTED #4
""",
        new=signing(world, again, name="new"),
    )
    restart(world, path, away=0.0, settles=0.0)
    opened(world, BOSS, again, Key("first", SECRET, "submitter"))
    check(
        world,
        """
new> TASK_CANCEL 2 : NOT_ALLOWED
first> TASK_MOVE 1 0 0 7 0 0 5 : ACCEPTED #3
first> TASK_CANCEL 2 : ACCEPTED #2
""",
        new=signing(world, again, name="newer"),
        first=signing(world, key, name="first"),
    )


def test_a_nonce_belongs_to_its_key(world: World, limited: Callable[..., FakeClient]) -> None:
    world.client = limited(max_speed=0.1, max_distance=1.0)
    check(
        world,
        """
boss> TASK_MOVE 12 1.6 0 4711 0 0 5 : ACCEPTED #1
TASK_MOVE 12 1.6 0 4711 0 0 5 : NOT_ALLOWED
TASK_MOVE 1 0 0 4711 0 0 5 : ACCEPTED #2
TASK_MOVE 1 0 0 4711 0 0 5 : ACCEPTED #2
""",
        boss=signing(world, BOSS, name="boss", system_id=77),  # the same address
    )
