"""What a link carries, shared among those who wish."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.mavlink import messages as m
from mav_tasks.services.interval_requester import WANTED
from mav_tasks.services.rate_budget import (
    OBSERVERS_SHARE,
    OBSERVERS_SHORTEST,
    OWN,
    granted,
    size_of,
    spare_of,
)

BATTERY, IMU, UNKNOWN = m.BatteryStatus.id, 27, 60_000
wishes = st.dictionaries(st.sampled_from([*WANTED, IMU, 105, UNKNOWN]), st.floats(0.001, 30.0))


def cost(intervals: dict[int, float]) -> float:
    """Return the bytes a second that are asked for beyond the server's own needs."""
    own = {number: 1 / interval for number, interval in WANTED.items()}
    return sum((1 / i - own.get(n, 0.0)) * size_of(n) for n, i in intervals.items())


def test_sizes_are_those_of_the_wire() -> None:
    assert (size_of(m.Attitude.id), size_of(m.LocalPositionNed.id)) == (40, 40)
    assert size_of(UNKNOWN) == 267
    assert pytest.approx(3221) == OWN


@pytest.mark.parametrize(
    ("capacity", "vehicles", "spare"),
    [(None, 1, 50_000 - OWN), (5760, 1, 0.7 * 5760 - OWN), (5760, 2, 0.0), (960, 1, 0.0)],
)
def test_what_is_left_of_a_link(capacity: float | None, vehicles: int, spare: float) -> None:
    assert spare_of(50_000, capacity, vehicles=vehicles) == pytest.approx(spare)


def test_a_wish_that_fits_is_granted() -> None:
    assert granted({IMU: 0.1}, {}, spare=10_000) == {IMU: 0.1}
    assert granted({}, {IMU: 0.02}, spare=10_000) == {IMU: OBSERVERS_SHORTEST}


def test_nobody_makes_slower_what_the_server_needs() -> None:
    assert granted({m.Attitude.id: 5.0}, {BATTERY: 60.0}, spare=1e6) == {}


def test_without_anything_to_spare_nothing_is_raised() -> None:
    assert granted({m.Attitude.id: 0.02, IMU: 0.02}, {BATTERY: 0.1}, spare=0.0) == {}


@given(wishes, wishes, st.floats(0.0, 20_000.0))
def test_all_wishes_together_cost_no_more_than_there_is(
    commanding: dict[int, float], observing: dict[int, float], spare: float
) -> None:
    assert cost(granted(commanding, observing, spare=spare)) <= spare * 1.03 + 1


@given(wishes, wishes, st.floats(100.0, 20_000.0))
def test_an_observer_changes_nothing_for_who_commands_and_has_its_share(
    commanding: dict[int, float], observing: dict[int, float], spare: float
) -> None:
    alone = granted(commanding, {}, spare=spare)
    both = granted(commanding, observing, spare=spare)
    assert all(both[number] <= interval for number, interval in alone.items())
    assert cost(both) - cost(alone) <= OBSERVERS_SHARE * spare * 1.03 + 1
