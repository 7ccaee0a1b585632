"""The order of a plan's steps."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.tasks.driving.mission_sequencer import (
    END,
    following,
    goes_on_to_a_place,
    is_over,
    loops_in_vain,
    present_goal,
    skipped_to,
    started,
)
from mav_tasks.tasks.goal import (
    Delay,
    GoTo,
    Jump,
    LocalPlace,
    Near,
    Nothing,
    Perform,
    Plan,
    SetSpeed,
    Step,
    Wait,
)
from mav_tasks.tasks.task import Progress

A, B, C = (GoTo(LocalPlace(float(n), 0.0)) for n in range(3))


def order(plan: Plan, *, limit: int = 100) -> list[int]:
    """Return the steps that are driven, in order."""
    steps: list[int] = []
    progress: Progress | None = started(plan, Progress())
    while progress is not None and len(steps) < limit:
        if not is_over(plan, progress):
            steps.append(progress.step)
        progress = following(plan, progress)
    return steps


def test_steps_are_driven_one_after_the_other_and_others_are_passed_over() -> None:
    assert order(Plan((Nothing(), A, Perform(), Nothing(), B, Wait(1.0), SetSpeed(1.0)))) == [
        1,
        4,
        5,
    ]


def test_it_begins_with_the_step_that_is_asked_for() -> None:
    assert order(Plan((A, B, C), first=1)) == [1, 2]


def test_an_empty_plan_is_over_at_once() -> None:
    progress = started(Plan(()), Progress())
    assert is_over(Plan(()), progress)
    assert present_goal(Plan(()), progress) is END


@pytest.mark.parametrize(
    ("times", "driven"),
    [(0, [0, 1, 3]), (1, [0, 1, 0, 1, 3]), (2, [0, 1, 0, 1, 0, 1, 3]), (-1, [0, 1] * 50)],
)
def test_a_jump_is_made_so_often(times: int, driven: list[int]) -> None:
    assert order(Plan((A, B, Jump(0, times), C))) == driven


def test_a_jump_may_lead_forward_and_past_the_end() -> None:
    assert order(Plan((A, Jump(3, 1), B, C))) == [0, 3]
    assert order(Plan((A, Jump(3, -1), B))) == [0]


def test_a_loop_within_a_loop_counts_over_the_whole_plan_as_autopilots_do() -> None:
    assert order(Plan((A, Jump(0, 1), B, Jump(0, 1)))) == [0, 0, 2, 0, 2]


def test_what_lies_between_belongs_to_the_way_to_the_next() -> None:
    plan = Plan((A, SetSpeed(1.0), Delay(2.0), Perform(), B, Near(3.0), Perform()))
    first = started(plan, Progress())
    assert first.pending == ()
    second = following(plan, first)
    assert second is not None
    assert (second.step, second.pending) == (4, (1, 2, 3))
    last = following(plan, second)
    assert last is not None
    assert (last.step, last.pending, is_over(plan, last)) == (7, (1, 2, 3, 5, 6), True)
    assert present_goal(plan, last) is END
    assert following(plan, last) is None


def test_what_is_still_pending_when_a_loop_comes_round_is_pending_once() -> None:
    progress = started(plan := Plan((A, Delay(86_400.0), Perform(), Jump(0, -1))), Progress())
    for _ in range(10):
        after = following(plan, progress)
        assert after is not None
        progress = after
    assert (progress.step, progress.pending) == (0, (1, 2))


def test_another_step_can_be_gone_on_with() -> None:
    plan = Plan((A, Nothing(), B, C))
    assert skipped_to(plan, started(plan, Progress()), 1).step == 2
    assert is_over(plan, skipped_to(plan, Progress(), 9))


def test_whether_a_place_follows() -> None:
    plan = Plan((A, SetSpeed(1.0), B, Wait(1.0), C))
    first = started(plan, Progress())
    assert goes_on_to_a_place(plan, first) == B
    second = following(plan, first)
    assert second is not None
    assert goes_on_to_a_place(plan, second) is None


def test_before_the_beginning_the_present_goal_is_the_first() -> None:
    assert present_goal(Plan((Nothing(), B)), Progress()) == B
    assert present_goal(A, Progress()) == A


@pytest.mark.parametrize(
    ("steps", "found"),
    [
        ((A, B, Jump(0, 3)), None),
        ((A, Jump(1, 1)), 1),
        ((A, Perform(), Jump(1, 2), B), 2),
        ((A, Jump(2, 1), Jump(1, 1)), 2),
        ((Jump(2, 1), A, Jump(0, 1), B), 2),  # forward over what would be driven
        ((A, Jump(0, 1), Jump(0, 1)), None),
        ((A, Wait(0.0), Jump(1, -1)), 2),
        ((A, Wait(1.0), Jump(1, -1)), None),
    ],
)
def test_a_loop_in_which_nothing_is_driven_is_found(
    steps: tuple[Step, ...], found: int | None
) -> None:
    assert loops_in_vain(Plan(steps)) == found


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
