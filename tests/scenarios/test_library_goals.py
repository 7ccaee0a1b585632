"""What a script asks for is what the server understands: goals and terms, through both ends."""

from collections.abc import Iterator
from datetime import datetime
from math import inf, nan, pi
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mav_tasks import Act, Drive, Face, GoTo, LocalPlace, Move, Rotate, SyncClient, Wait
from mav_tasks.config.settings import Driving, Settings
from mav_tasks.plans import GeoPoint, PlanFile
from rover_sim.testing.rover_world import RoverWorld
from tests.scenarios.conftest import MakeRoverWorld

rates = st.none() | st.floats(0.01, 1.5)
moves = st.builds(
    Move, st.floats(0.01, 90.0) | st.floats(-90.0, -0.01), st.none() | st.floats(0.02, 1.9)
)
rotations = st.builds(Rotate, st.floats(0.01, 60.0) | st.floats(-60.0, -0.01), rates)
turns = st.floats(-1.5, 1.5).filter(lambda rate: rate == 0 or abs(rate) > 1e-9)
drives = st.builds(Drive, st.floats(0.1, 1.9), turns, st.floats(0.1, 300.0))
faces = st.builds(Face, st.floats(0.0, 2 * pi - 0.001), st.sampled_from((-1, 0, 1)), rates)
waits = st.builds(Wait, st.floats(0.1, 80_000.0))
singles = st.floats(-1e6, 1e6, width=32)
integers = st.integers(-10_000, 10_000).map(float)
acts = st.builds(
    Act,
    st.sampled_from((181, 183, 203, 2000)),
    st.tuples(*[singles] * 4, integers, integers, singles),
    st.integers(1, 255),
    st.floats(1.0, 600.0),
)
places = st.builds(
    GoTo,
    st.builds(LocalPlace, st.floats(-90.0, 90.0), st.floats(-90.0, 90.0)),
    yaw=st.none() | st.floats(0.001, pi),
    wait=st.floats(1.0, 1e4),
    radius=st.floats(0.1, 5.0),
)


def assert_close(one: Any, other: Any) -> None:
    """Fail unless two goals are the same, but for what float32 and degrees take away."""
    assert type(one) is type(other), (one, other)
    if not isinstance(one, float):
        if not hasattr(one, "__slots__"):
            assert one == other
            return
        for name in one.__slots__:
            assert_close(getattr(one, name), getattr(other, name))
    else:
        assert one == pytest.approx(other, rel=1e-5, abs=1e-4)


@pytest.fixture
def world(make_rover_world: MakeRoverWorld) -> RoverWorld:
    return make_rover_world(settings=Settings(driving=Driving(max_distance=10_000.0)))


@pytest.fixture
def client(world: RoverWorld) -> Iterator[SyncClient]:
    """A client of a server whose queue is paused."""
    with world.sync_client() as opened:
        opened.pause()
        yield opened


def test_each_goal_arrives_as_it_was_asked_for(world: RoverWorld, client: SyncClient) -> None:
    @settings(max_examples=60, derandomize=True, suppress_health_check=list(HealthCheck))
    @given(
        moves | rotations | drives | faces | waits | places | acts,
        st.integers(0, 10),
        st.floats(1.0, 1e4),
        st.booleans(),
    )
    def arrives(goal: Any, priority: int, delay: float, is_plan: bool) -> None:
        asked: Any = [goal, Wait(1.0)] if is_plan else goal
        now = world.now
        task = client.submit(asked, priority=priority, delay=delay, deadline=delay + 60)
        found: Any = world.server.task(task.id)
        kept: Any = getattr(found.goal, "steps", (found.goal,))  # some goals are always a plan
        assert_close(goal, kept[1] if isinstance(goal, Act) else kept[0])
        assert None not in kept
        assert found.terms.priority == priority
        assert found.terms.start_at == pytest.approx(now + delay, rel=1e-5, abs=3.0)
        assert found.terms.deadline - found.terms.start_at == pytest.approx(60.0, abs=3.0)
        client.clear()

    arrives()


def test_a_place_that_is_passed_says_no_more_than_where_it_is(
    world: RoverWorld, client: SyncClient
) -> None:
    passed = GoTo(LocalPlace(1.0, 2.0), passes=True)
    found: Any = world.server.task(client.submit([passed, Wait(1.0)]).id)
    assert found.goal.steps[0] == passed


def test_what_cannot_be_meant_is_named_before_anything_is_sent(client: SyncClient) -> None:
    goals: dict[str, Any] = {
        "distance": Move(nan),
        "distance is not a number": Move("2"),  # type: ignore[arg-type]
        "speed 1e-46 is too small to send": Move(2.0, 1e-46),
        "duration 1e.39 is too large to send": Wait(1e39),
        "yaw_rate": Drive(1.0, inf, 1.0),
        "too far away": GoTo(LocalPlace(1e9, 0.0)),
        "north": GoTo(LocalPlace(nan, 0.0)),
        "return": GoTo(None, wait=3.0),
        "expected a goal": "move",
    }
    terms: dict[str, dict[str, Any]] = {
        "priority 11": {"priority": 11},
        "priority True": {"priority": True},
        "after 1073741824": {"after": 2**30},
        "delay -1.0": {"delay": -1.0},
        "deadline nan": {"deadline": nan},
        "deadline 1e-46 is too small to send": {"deadline": 1e-46},
        "every True: expected whole seconds": {"every": True},
        "an expression names the start times": {"every": "0 6 * * *", "delay": 5.0},
        "a datetime needs a time zone": {"at": datetime(2030, 1, 1)},  # noqa: DTZ001
    }
    cases: list[tuple[str, Any, dict[str, Any]]]
    cases = [(words, [goal], {}) for words, goal in goals.items()]
    cases += [(words, [Move(1.0)], more) for words, more in terms.items()]
    cases += [("no goals", [], {})]
    for words, asked, more in cases:
        with pytest.raises(ValueError, match=words):
            client.submit(asked, **more)
    rally = PlanFile((), None, (), (GeoPoint(1, 2, 0.0),))
    for plan, words in (([], "it has no items"), (rally, "only a fence")):
        with pytest.raises(ValueError, match=words):
            client.submit_mission(plan)
    with pytest.raises(ValueError, match="expected one of again, remainder, skip"):
        client.release(None, "perhaps")  # type: ignore[arg-type]
    assert client.queue().waiting_count == 0
