from dataclasses import dataclass, fields, is_dataclass, replace
from enum import Enum
from typing import Any, get_args

import hypothesis.strategies as st
import pytest
from hypothesis import given, settings

from mav_tasks.store.codec import (
    MONOTONIC,
    Decoder,
    Encoder,
    Unreadable,
    dumps,
    format_of,
    loads,
)
from mav_tasks.tasks.events import Event, TaskSubmitted
from mav_tasks.tasks.goal import Goal, GoTo, LocalPlace, Move
from mav_tasks.tasks.task import Draft, Frame, Task
from tests.unit.store.samples import OFFSET, submitted

#: UTC in their own right: never moved
UTC = frozenset({"start_utc"})

# On disk a time has some nanoseconds less: these lose nothing.
NUMBERS = st.integers(-(2**20), 2**20).map(lambda n: n / 8)
st.register_type_strategy(float, NUMBERS)
ANY_EVENT = st.one_of(*(st.from_type(kind) for kind in get_args(Event)))


def there_and_back(value: Any, *, offset: float = OFFSET) -> Any:
    kind = type(value)
    row = loads(dumps(Encoder().row(value, offset=offset)))
    (back,) = Decoder(loads(dumps(format_of(kind)))).values(kind, [row], offset=offset)
    return back


def with_goal(event: TaskSubmitted, goal: Goal) -> TaskSubmitted:
    return replace(event, task=replace(event.task, goal=goal))


@settings(max_examples=400, deadline=None, derandomize=True)
@given(event=ANY_EVENT)
def test_every_event_comes_back(event: Event) -> None:
    back = there_and_back(event)
    assert back == event
    assert repr(back) == repr(event)  # enums are enums, floats are floats


@pytest.mark.parametrize("kind", get_args(Goal))
def test_every_goal_comes_back_as_what_it_was(kind: type) -> None:
    @settings(max_examples=30, deadline=None, derandomize=True)
    @given(goal=st.from_type(kind))
    def check(goal: Any) -> None:
        event = with_goal(submitted(1), goal)
        assert there_and_back(event) == event

    check()


def test_many_rows_of_several_goals_keep_their_order() -> None:
    goals: list[Goal] = [Move(1.0), GoTo(None), Move(2.0), GoTo(LocalPlace(1.0, 2.0)), Move(3.0)]
    rows = [Encoder().row(with_goal(submitted(n), g), offset=0.0) for n, g in enumerate(goals)]
    kind = type(submitted(1))
    back = Decoder(format_of(kind)).values(kind, rows, offset=0.0)
    assert [(event.task.id, event.task.goal) for event in back] == list(enumerate(goals))


def test_times_are_utc_on_the_way() -> None:
    event = submitted(1, at=5.0)
    row = Encoder().row(event, offset=1000.0)
    names = format_of(type(event))["TaskSubmitted"]
    at = {name: row[names.index(name)] for name in ("at", "task.submitted_at")}
    assert at == {"at": 1005.0, "task.submitted_at": 1005.0}
    (back,) = Decoder(format_of(type(event))).values(type(event), [row], offset=990.0)
    assert (back.at, back.task.terms.deadline, back.task.terms.start_at) == (15.0, 75.0, None)


def test_every_field_that_is_a_time_is_known_as_one() -> None:
    kinds = {kind for kind in _all_kinds() if kind is not Draft}
    named = {
        field.name
        for kind in kinds
        for field in fields(kind)
        if field.name == "at" or field.name.endswith(("_at", "_utc")) or "deadline" in field.name
    }
    assert named - UTC <= MONOTONIC, "say in the codec, or here, what kind of time it is"
    assert not MONOTONIC & UTC


def _all_kinds() -> set[type]:
    import mav_tasks.tasks.events
    import mav_tasks.tasks.task

    return {
        kind
        for module in (mav_tasks.tasks.events, mav_tasks.tasks.task)
        for kind in vars(module).values()
        if isinstance(kind, type) and is_dataclass(kind)
    }


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_what_is_no_number_is_refused(value: float) -> None:
    with pytest.raises(ValueError, match="JSON"):
        dumps(Encoder().row(Move(value), offset=0.0))


@dataclass(frozen=True)
class Colour:
    red: float
    green: float = 0.5


class Size(Enum):
    SMALL = "small"


@dataclass(frozen=True)
class Thing:
    name: str
    colour: Colour
    places: tuple[LocalPlace, ...] = ()
    size: Size | None = None
    extra: Colour = Colour(9.0)


THING = Thing("ball", Colour(0.25), (LocalPlace(1.0, 2.0),), Size.SMALL)


def test_tuples_enums_and_values_within_come_back() -> None:
    assert there_and_back(THING) == THING
    assert there_and_back(Thing("x", Colour(1.0))) == Thing("x", Colour(1.0))


def test_a_field_that_an_older_format_lacks_takes_its_default() -> None:
    older = Decoder({"Thing": ("name", "colour.red")})
    assert older.values(Thing, [["ball", 0.25]], offset=0.0) == [Thing("ball", Colour(0.25))]


def test_a_field_that_is_no_more_is_passed_over() -> None:
    older = Decoder({"Colour": ("red", "smell", "green")})
    assert older.values(Colour, [[1.0, "sweet", 0.0]], offset=0.0) == [Colour(1.0, 0.0)]


@pytest.mark.parametrize(
    ("kind", "row", "words"),
    [
        (GoTo, [["Moon", 1.0], None, None, None, 0.0], "Moon"),
        (Colour, [], "Colour"),
        (Frame, [1, 2, 3, 4], "Frame"),
    ],
)
def test_what_this_version_does_not_know_is_said(kind: type, row: list[Any], words: str) -> None:
    written = {**format_of(Colour, GoTo), "Frame": ("latitude_degE7", "x", "y", "z")}
    with pytest.raises(Unreadable, match=words):
        Decoder(written).values(kind, [row], offset=0.0)


def test_a_type_without_a_way_is_our_own_mistake() -> None:
    @dataclass
    class Odd:
        what: complex

    with pytest.raises(TypeError, match="complex"):
        format_of(Odd)


def test_the_format_has_every_event() -> None:
    names = format_of(*get_args(Event))
    assert {kind.__name__ for kind in get_args(Event)} <= names.keys()
    assert {kind.__name__ for kind in get_args(Goal)} <= names.keys()
    assert all(field.name for field in fields(Task))
