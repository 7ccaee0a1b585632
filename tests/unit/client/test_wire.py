"""What a script asks for is what the server understands: goals there and back through both ends."""

from math import inf, nan, pi, remainder, tau

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mav_tasks.client import wire
from mav_tasks.client.wire import Goal, TaskOptions
from mav_tasks.engine.commands import goals as engine_goals
from mav_tasks.engine.commands.ability import Ability
from mav_tasks.engine.missions.plan_items import plan_of, steps_of
from mav_tasks.engine.missions.plan_table import MissionParseOptions
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.packet import split_datagram
from mav_tasks.plan_files.values import PlanItem
from mav_tasks.services.command_receiver import command_of
from mav_tasks.services.mission_item import Item, item_of, message_of
from mav_tasks.settings import Driving
from mav_tasks.tasks.goal import (
    Drive,
    Face,
    GlobalPlace,
    GoTo,
    Jump,
    LocalPlace,
    Move,
    Nothing,
    Rotate,
    SetSpeed,
    Wait,
)

FEW = settings(max_examples=40, deadline=None)
DRIVING = Driving()
MANNER = MissionParseOptions(has_home=False, ability=Ability(), driving=DRIVING)
HERE = Address(244, 190)
THERE = Address(1, 191)

distances = st.floats(0.01, 9_000.0) | st.floats(-9_000.0, -0.01)
speeds = st.none() | st.floats(0.02, 1.9)
rates = st.none() | st.floats(0.01, 1.5)
moves = st.builds(Move, distances, speeds)
rotations = st.builds(Rotate, st.floats(0.01, 60.0) | st.floats(-60.0, -0.01), rates)
turns = st.just(0.0) | st.floats(0.001, 1.5) | st.floats(-1.5, -0.001)
drives = st.builds(Drive, st.floats(0.1, 1.9), turns, st.floats(0.1, 3_000.0))
#: 0, or so long that a float32 is not 0
seconds = st.just(0.0) | st.floats(0.001, 1e4)
places = st.builds(LocalPlace, st.floats(-5e3, 5e3), st.floats(-5e3, 5e3)) | st.builds(
    GlobalPlace,
    st.integers(1, 900_000_000) | st.integers(-900_000_000, -1),
    st.integers(-1_800_000_000, 1_800_000_000),
)
headings = st.floats(0.0, 2 * pi - 0.001)
waits = st.builds(Wait, st.floats(0.1, 80_000.0))
faces = st.builds(Face, headings, st.sampled_from((-1, 0, 1)), rates)


def over_the_wire(message: object) -> object:
    """Return a message as it arrives: numbers as float32."""
    (packet,) = split_datagram(Encoder(HERE).encode(message))  # type: ignore[arg-type]
    return Decoder().decode(packet)


def close(one: Goal, other: object) -> bool:
    """Whether two goals are the same, but for what float32 and degrees take away."""
    assert type(one) is type(other), (one, other)
    for name in one.__slots__:
        a, b = getattr(one, name), getattr(other, name)
        if isinstance(a, LocalPlace):
            same = abs(a.north - b.north) < 1e-4 and abs(a.east - b.east) < 1e-4
        elif isinstance(a, float) and isinstance(b, float):
            same = a == pytest.approx(b, rel=1e-5, abs=1e-5)
        else:
            same = a == b
        assert same, (name, a, b)
    return True


@FEW
@given(moves | rotations | drives, st.integers(0, 10), st.integers(0, 2**24 - 1), seconds)
def test_a_goal_of_our_own_arrives_with_its_terms(
    goal: Move | Rotate | Drive, priority: int, after: int, delay: float
) -> None:
    terms = TaskOptions(priority=priority, after=after, delay=delay)
    message = over_the_wire(wire.command_of(goal, terms, target=THERE, nonce=77))
    wish = engine_goals.parse_command(command_of(message), b"", DRIVING, now=100.0)  # type: ignore[arg-type]
    assert close(goal, wish.goal)
    assert (wish.terms.priority, wish.terms.after, wish.marks.nonce) == (priority, after, 77)
    started = 0.0 if wish.terms.start_at is None else wish.terms.start_at - 100.0
    assert started == pytest.approx(delay, rel=1e-6, abs=1e-9)


def arrived(items: tuple[Item, ...]) -> tuple[Item, ...]:
    """Return items as they arrive."""
    found = []
    for seq, item in enumerate(items):
        back = item_of(over_the_wire(message_of(item, seq, 0, to=THERE)))  # type: ignore[arg-type]
        assert back is not None
        found.append(back)
    return tuple(found)


@FEW
@given(moves | rotations | drives | waits | faces)
def test_a_goal_arrives_as_a_step_of_a_plan(goal: Goal) -> None:
    (step,) = steps_of(arrived(wire.items_of_goals([goal])), manner=MANNER)
    assert close(goal, step)


@FEW
@given(places, st.none() | st.floats(0.02, 900.0), st.none() | headings, seconds)
def test_a_place_is_driven_to_and_stopped_at(
    place: LocalPlace, radius: float | None, yaw: float | None, wait: float
) -> None:
    goal = GoTo(place, None, radius, yaw, wait)
    (step,) = steps_of(arrived(wire.items_of_goals([goal])), manner=MANNER)
    assert isinstance(step, GoTo)
    assert not step.passes
    assert step.wait == pytest.approx(max(wait, wire.STOPPING), rel=1e-5)
    assert step.radius == pytest.approx(radius or wire.ON_THE_SPOT, rel=1e-5)
    if yaw is not None:
        assert step.yaw is not None
        assert remainder(step.yaw - yaw, tau) == pytest.approx(0.0, abs=1e-5)


def test_a_place_that_is_passed_says_no_more_than_where_it_is() -> None:
    (step,) = steps_of(wire.items_of_goals([GoTo(LocalPlace(1, 2), passes=True)]), manner=MANNER)
    assert step == GoTo(LocalPlace(1.0, 2.0), passes=True)


def test_a_speed_holds_for_one_way_only() -> None:
    steps = steps_of(wire.items_of_goals([GoTo(None, speed=0.4), Wait(2.0)]), manner=MANNER)
    assert steps == (SetSpeed(0.4), GoTo(None), SetSpeed(None), Wait(2.0))


def test_the_options_of_a_plan_are_its_terms_and_make_it_unlike_any_other() -> None:
    terms = TaskOptions(priority=8, after=3, delay=5.0, deadline=60.0)
    items = wire.items_of_goals([Wait(1.0)])
    plans = [(*items, wire.options_of(terms, nonce=nonce)) for nonce in (1, 2)]
    wanted = [
        plan_of(plan, steps_of(plan, manner=MANNER), has_home=False, now=10.0) for plan in plans
    ]
    for each in wanted:
        assert each.plan.steps == (Wait(1.0), Nothing())
        kept = each.terms
        assert (kept.priority, kept.after, kept.start_at, kept.deadline) == (8, 3, 15.0, 70.0)
    assert wanted[0].plan.source != wanted[1].plan.source


def test_more_bits_of_a_nonce_make_another_plan() -> None:
    one, other = (wire.options_of(TaskOptions(), nonce=7, check=check) for check in (0, 8))
    assert (one.x, one.y, other.x, other.y) == (7, 0, 7, 8)
    for wrong in (-1, 2**31 - 1, True):
        with pytest.raises(ValueError, match="check"):
            wire.check_check(wrong)


def test_a_jump_goes_one_further_behind_a_home() -> None:
    jump = PlanItem(MavCmd.DO_JUMP, 2, (0.0, 3.0, 0.0, 0.0), 0, 0, 0.0, True)
    items = (*wire.items_of_goals([Move(1.0)]), *wire.items_of_file([jump]))
    behind = wire.with_home(items)
    has_home = MANNER._replace(has_home=True)
    assert steps_of(behind, manner=has_home) == (Nothing(), Move(1.0), Jump(1, 3))


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (lambda: TaskOptions(priority=11), "priority 11"),
        (lambda: TaskOptions(priority=True), "priority True"),
        (lambda: TaskOptions(priority=5.0), "priority 5.0"),  # type: ignore[arg-type]
        (lambda: TaskOptions(after=2**30), "after 1073741824"),
        (lambda: TaskOptions(delay=-1.0), "delay -1.0"),
        (lambda: TaskOptions(deadline=nan), "deadline nan"),
        (lambda: wire.items_of_goals([Move(nan)]), "distance"),
        (lambda: wire.items_of_goals([Move("2")]), "distance is not a number"),  # type: ignore[arg-type]
        (lambda: wire.items_of_goals([Move(2.0, 1e-46)]), "speed 1e-46 is too small to send"),
        (lambda: wire.items_of_goals([GoTo(None, 1e-300)]), "speed 1e-300 is too small to send"),
        (lambda: wire.items_of_goals([Wait(1e39)]), "duration 1e.39 is too large to send"),
        (lambda: TaskOptions(deadline=1e-46), "deadline 1e-46 is too small to send"),
        (lambda: wire.items_of_goals(["move"]), "'move': expected a goal"),  # type: ignore[list-item]
        (lambda: wire.items_of_goals([Drive(1.0, inf, 1.0)]), "yaw_rate"),
        (lambda: wire.items_of_goals([Wait(inf)]), "duration"),
        (lambda: wire.items_of_goals([GoTo(LocalPlace(1e9, 0.0))]), "too far away"),
        (lambda: wire.items_of_goals([GoTo(LocalPlace(nan, 0.0))]), "north"),
        (lambda: wire.items_of_goals([GoTo(None, wait=3.0)]), "return"),
    ],
)
def test_what_cannot_be_meant_is_named(wrong: object, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        wrong()  # type: ignore[operator]
