"""The order of a plan's steps."""

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.kinds import GoTo, LocalPlace, Wait
from mav_tasks.tasks.driving.mission_sequencer import (
    END,
    following,
    is_over,
    look_on_the_way,
    loops_in_vain,
    present_goal,
    started,
)
from mav_tasks.tasks.goal import Delay, Jump, Near, Nothing, Perform, Plan, SetSpeed, Step
from mav_tasks.tasks.task import Progress

A, B, C = (GoTo(LocalPlace(float(n), 0.0)) for n in range(3))
STEPS: dict[str, Any] = {"A": A, "B": B, "C": C, "nothing": Nothing(), "perform": Perform()}
KINDS: dict[str, Any] = {"jump": Jump, "wait": Wait, "speed": SetSpeed}


def plan_of(text: str) -> Plan:
    """Return the plan of steps in words, some with numbers."""
    words = (word.rstrip(")").partition("(") for word in text.split())
    return Plan(
        tuple(
            KINDS[name](*map(int, values.split(","))) if values else STEPS[name]
            for name, _, values in words
        )
    )


def order(plan: Plan, *, limit: int = 100) -> list[int]:
    """Return the steps that are driven, in order."""
    steps: list[int] = []
    progress: Progress | None = started(plan, Progress())
    while progress is not None and len(steps) < limit:
        if not is_over(plan, progress):
            steps.append(progress.step)
        progress = following(plan, progress)
    return steps


def test_steps_are_driven_in_order_and_jumps_as_often_as_they_say() -> None:
    rows = """nothing A perform nothing B wait(1) speed(1): 1 4 5
        A B jump(0,0) C: 0 1 3
        A B jump(0,1) C: 0 1 0 1 3
        A B jump(0,2) C: 0 1 0 1 0 1 3
        A jump(3,1) B C: 0 3
        A jump(3,-1) B: 0
        A jump(0,1) B jump(0,1): 0 0 2 0 2
        :"""  # a jump past the end; a loop within a loop counts over the whole plan
    for row in rows.splitlines():
        text, _, driven = row.partition(":")
        assert order(plan_of(text)) == [int(step) for step in driven.split()], row
    assert order(Plan((A, B, C), first=1)) == [1, 2]
    assert order(plan_of("A B jump(0,-1) C")) == [0, 1] * 50
    assert present_goal(Plan(()), started(Plan(()), Progress())) is END


def test_what_lies_between_belongs_to_the_way_to_the_next() -> None:
    plan = Plan((A, SetSpeed(1.0), Delay(2.0), Perform(), B, Near(3.0), Perform()))
    first = started(plan, Progress())
    assert first.pending == ()
    second = following(plan, first)
    assert second is not None
    assert (second.step, second.pending) == (4, (1, 2, 3))
    for elapsed, left in ((1.0, (2, 3)), (2.5, ())):
        found = look_on_the_way(plan, second, to_place=9.0, elapsed=elapsed)
        assert found.progress.pending == left
    last = following(plan, second)
    assert last is not None
    assert (last.step, last.pending, is_over(plan, last)) == (7, (1, 2, 3, 5, 6), True)
    assert present_goal(plan, last) is END
    assert following(plan, last) is None


def test_a_loop_in_which_nothing_is_driven_is_found() -> None:
    for row in """A B jump(0,3): none
        A jump(1,1): 1
        A perform jump(1,2) B: 2
        A jump(2,1) jump(1,1): 2
        jump(2,1) A jump(0,1) B: 2
        A jump(0,1) jump(0,1): none
        A wait(0) jump(1,-1): 2
        A wait(1) jump(1,-1): none""".splitlines():  # the fifth: forward over what would be driven
        text, _, found = row.partition(": ")
        assert loops_in_vain(plan_of(text)) == (None if found == "none" else int(found)), row


steps_of_any_kind = st.lists(
    st.one_of(
        st.just(A),
        st.just(Nothing()),
        st.just(Perform()),
        st.builds(Jump, st.integers(0, 12), st.integers(-1, 3)),
    ),
    max_size=12,
)


@given(steps_of_any_kind)
def test_a_plan_that_does_not_loop_in_vain_always_comes_to_its_next_step(
    steps: list[Step],
) -> None:
    plan = Plan(tuple(steps))
    if loops_in_vain(plan) is None:
        order(plan)  # a walk without an end would never return


def test_a_long_plan_of_jumps_is_looked_through_quickly() -> None:
    plan = Plan((*(Jump(number + 1, 1) for number in range(5_000)), A, Jump(0, -1)))
    assert loops_in_vain(plan) is None
