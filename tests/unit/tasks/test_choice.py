"""The choice of a rover for a task that any rover may drive."""

from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.errors import Rejection
from mav_tasks.tasks.choice import Candidate, choose, why_not
from mav_tasks.tasks.lifecycle import TaskReason as R

BOUND = 0.2

seconds = st.floats(0, 1e4) | st.just(nan)
candidates = st.builds(
    Candidate,
    vehicle=st.integers(1, 255),
    is_heard=st.booleans(),
    paused=st.sampled_from((R.NONE, R.STOPPED, R.OPERATOR, R.FAILSAFE)),
    is_held_ahead=st.booleans(),
    is_driven_by_client=st.booleans(),
    blocker=st.sampled_from((R.NONE, R.WRONG_MODE, R.NO_POSITION)),
    is_full=st.booleans(),
    inability=st.sampled_from(("", "it cannot reverse")),
    battery=st.none() | st.floats(0, 1),
    free_in=seconds,
    distance=seconds,
    speed=st.floats(0.05, 10),
    waiting=st.integers(0, 1000),
)
fleets = st.lists(candidates, max_size=6, unique_by=lambda each: each.vehicle)


def chosen(*candidates: Candidate) -> tuple[int, str]:
    return choose(candidates, least_battery=BOUND)


def test_the_nearest_free_rover_is_chosen_and_the_words_compare_it_with_the_others() -> None:
    far = Candidate(1, distance=30.0, battery=0.5)
    near = Candidate(2, distance=12.0, battery=0.81)
    low = Candidate(3, battery=0.15)
    assert chosen(far, near, low) == (
        2,
        (
            "free, 12 m away, battery 81%"
            " (rover 1: begins in 30 s; rover 3: battery 15%, less than 20%)"
        ),
    )


def test_the_end_of_the_queue_and_the_way_count_together() -> None:
    busy_here = Candidate(1, free_in=20.0)
    free_there = Candidate(2, distance=30.0, speed=2.0)
    assert chosen(busy_here, free_there)[0] == 2
    slow = free_there._replace(speed=1.0)
    assert chosen(busy_here, slow) == (1, "free in 20 s (rover 2: begins in 30 s)")


def test_an_end_that_is_not_known_comes_last_and_then_the_shorter_queue_counts() -> None:
    unknown = Candidate(1, free_in=nan, waiting=60)
    assert unknown.begins_in == inf
    assert chosen(unknown, Candidate(2, free_in=1e6))[0] == 2
    words = "free in an unknown time (rover 1: begins in an unknown time)"
    assert chosen(unknown, Candidate(2, free_in=nan, waiting=59)) == (2, words)


@pytest.mark.parametrize(
    ("candidate", "reason", "words"),
    [
        (Candidate(4, is_heard=False), R.VEHICLE_SILENT, "silent"),
        (Candidate(4, paused=R.STOPPED), R.STOPPED, "STOP in force"),
        (Candidate(4, paused=R.TAKEOVER), R.QUEUE_PAUSED, "queue paused (takeover)"),
        (Candidate(4, is_held_ahead=True), R.HELD_AHEAD, "a task is held"),
        (Candidate(4, is_driven_by_client=True), R.OTHER_CONTROLLER, "a client drives it"),
        (Candidate(4, battery=0.19), R.NOT_READY, "battery 19%, less than 20%"),
        (Candidate(4, blocker=R.DISARMED), R.DISARMED, "disarmed"),
        (Candidate(4, is_full=True), R.QUEUE_FULL, "queue full"),
        (Candidate(4, inability="no"), R.NOT_SUPPORTED_BY_VEHICLE, "no"),
    ],
)
def test_what_keeps_a_rover_from_being_chosen(candidate: Candidate, reason: R, words: str) -> None:
    with pytest.raises(Rejection) as refused:
        chosen(candidate)
    assert (refused.value.reason, refused.value.text) == (reason, f"no rover can: rover 4: {words}")


def test_a_refusal_names_every_rover_and_has_a_reason_that_may_pass() -> None:
    unable = Candidate(1, inability="it cannot reverse")
    with pytest.raises(Rejection) as refused:
        chosen(unable, Candidate(2, is_heard=False))
    assert refused.value.reason == R.VEHICLE_SILENT
    assert refused.value.text == "no rover can: rover 1: it cannot reverse; rover 2: silent"
    with pytest.raises(Rejection, match="no rover is heard"):
        chosen()


def test_a_long_list_of_others_is_cut() -> None:
    _, words = chosen(*(Candidate(each, free_in=float(each)) for each in range(1, 21)))
    assert words.count("begins in") == 8
    assert words.endswith("; and others)")


@given(fleets)
def test_only_a_rover_that_can_begin_is_chosen_and_none_that_would_begin_earlier(
    fleet: list[Candidate],
) -> None:
    able = [each for each in fleet if why_not(each, least_battery=BOUND) is None]
    if not able:
        with pytest.raises(Rejection) as refused:
            choose(fleet, least_battery=BOUND)
        assert all(f"rover {each.vehicle}: " in refused.value.text for each in fleet)
        return
    number, words = choose(fleet, least_battery=BOUND)
    (best,) = (each for each in able if each.vehicle == number)
    assert all(best.begins_in <= each.begins_in for each in able)
    assert best.is_heard
    assert not best.paused
    assert best.battery is None or best.battery >= BOUND
    assert all(f"rover {each.vehicle}: " in words for each in fleet if each is not best)


@given(fleets, st.randoms())
def test_the_order_of_the_rovers_does_not_matter(fleet: list[Candidate], random: object) -> None:
    mixed = list(fleet)
    random.shuffle(mixed)  # type: ignore[attr-defined]
    try:
        expected = choose(fleet, least_battery=BOUND).vehicle
    except Rejection:
        with pytest.raises(Rejection):
            choose(mixed, least_battery=BOUND)
        return
    assert choose(mixed, least_battery=BOUND).vehicle == expected
