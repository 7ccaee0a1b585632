"""Thinning of telemetry for one client."""

from random import Random

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.services.message_interval import (
    DEFAULT,
    GROUPS,
    MAX_WISHES,
    STOPPED,
    STREAMED,
    StreamRateLimiter,
)

ATTITUDE = m.Attitude.id


def rate(
    thinner: StreamRateLimiter, *, incoming: float, seconds: float = 200.0, jitter: float = 0.0
) -> float:
    """Messages a second that pass, of a stream of so many a second."""
    random = Random(12)
    period = 1.0 / incoming
    times = [
        n * period + random.uniform(0, jitter) * period for n in range(int(seconds * incoming))
    ]
    return sum(thinner.passes(1, 1, ATTITUDE, now=now) for now in times) / seconds


@pytest.mark.parametrize("wanted", [1.0, 2.0, 5.0, 10.0, 25.0])
@pytest.mark.parametrize("incoming", [25.0, 50.0, 400.0])
def test_in_the_long_run_a_client_gets_the_rate_that_it_asked_for(
    wanted: float, incoming: float
) -> None:
    thinner = StreamRateLimiter(default_interval=0.1)
    thinner.set_interval(1, ATTITUDE, 1e6 / wanted)
    assert rate(thinner, incoming=incoming) == pytest.approx(wanted, rel=0.05)


@pytest.mark.parametrize("wanted", [3.0, 4.0, 7.0, 10.0, 20.0])
def test_a_rate_that_does_not_divide_the_streams_is_met_all_the_same(wanted: float) -> None:
    thinner = StreamRateLimiter(default_interval=0.1)
    thinner.set_interval(1, ATTITUDE, 1e6 / wanted)
    assert rate(thinner, incoming=25.0) == pytest.approx(wanted, rel=0.05)


@pytest.mark.parametrize("jitter", [0.2, 0.5, 0.9])
def test_the_jitter_of_a_stream_does_not_thin_it(jitter: float) -> None:
    thinner = StreamRateLimiter(default_interval=0.1)
    thinner.set_interval(1, ATTITUDE, 1e6 / 25.0)
    assert rate(thinner, incoming=25.0, jitter=jitter) == pytest.approx(25.0, rel=0.1)


def test_nobody_gets_more_than_there_is() -> None:
    thinner = StreamRateLimiter(default_interval=0.1)
    thinner.set_interval(1, ATTITUDE, 1e6 / 100.0)
    assert rate(thinner, incoming=25.0) == 25.0


def test_unless_asked_a_client_gets_the_default_rate() -> None:
    thinner = StreamRateLimiter(default_interval=0.1)
    assert rate(thinner, incoming=50.0) == pytest.approx(10.0, rel=0.05)
    assert thinner.interval_us(1, ATTITUDE) == 100_000


def test_after_a_pause_at_most_one_comes_early() -> None:
    thinner = StreamRateLimiter(default_interval=0.1)
    thinner.passes(1, 1, ATTITUDE, now=0.0)
    passed = [n for n in range(20) if thinner.passes(1, 1, ATTITUDE, now=60.0 + n * 0.02)]
    assert passed == [0, 1, 4, 9, 14, 19]


def test_a_stopped_stream_is_silent_and_the_default_brings_it_back() -> None:
    thinner = StreamRateLimiter(default_interval=0.1)
    thinner.set_interval(1, ATTITUDE, STOPPED)
    assert (rate(thinner, incoming=50.0), thinner.interval_us(1, ATTITUDE)) == (0.0, STOPPED)
    thinner.set_interval(1, ATTITUDE, DEFAULT)
    assert thinner.interval_us(1, ATTITUDE) == 100_000
    assert thinner.passes(1, 1, ATTITUDE, now=1e4)


def test_wishes_are_kept_for_each_vehicle() -> None:
    thinner = StreamRateLimiter(default_interval=0.1)
    thinner.set_interval(1, ATTITUDE, 20_000)
    thinner.set_interval(2, ATTITUDE, 500_000)
    thinner.set_interval(1, m.VfrHud.id, STOPPED)
    assert [thinner.wishes(system) for system in (1, 2, 3)] == [
        {ATTITUDE: 0.02},
        {ATTITUDE: 0.5},
        {},
    ]


def test_sources_and_kinds_are_thinned_apart() -> None:
    thinner = StreamRateLimiter(default_interval=0.1)
    first = [(1, 1, ATTITUDE), (1, 2, ATTITUDE), (2, 1, ATTITUDE), (1, 1, m.VfrHud.id)]
    assert [thinner.passes(*key, now=0.0) for key in first + first] == [True] * 4 + [False] * 4


@pytest.mark.parametrize(
    "message",
    [m.Heartbeat, m.CommandAck, m.Statustext, m.ParamValue, m.MissionRequestInt, m.HomePosition],
)
def test_answers_and_events_are_never_thinned(message: type[m.Message]) -> None:
    thinner = StreamRateLimiter(default_interval=10.0)
    assert message.id not in STREAMED
    assert all(thinner.passes(1, 1, message.id, now=0.0) for _ in range(5))


def test_wishes_of_one_client_are_bounded() -> None:
    thinner = StreamRateLimiter(default_interval=0.1)
    for message_id in range(10 * MAX_WISHES):
        thinner.set_interval(1, message_id, 1e6)
    assert len(thinner.wishes(1)) == MAX_WISHES
    thinner.set_interval(1, 0, 2e6)  # one that is there may still be changed
    assert thinner.interval_us(1, 0) == 2_000_000


def test_every_stream_of_many_vehicles_has_its_rate() -> None:
    thinner = StreamRateLimiter(default_interval=0.1)
    for system_id in range(1, 21):
        thinner.set_group(system_id, 0, 2)
    assert {thinner.interval_us(n, ATTITUDE) for n in range(1, 21)} == {500_000}


def test_a_group_of_messages_has_its_rate_until_one_is_asked_for_by_itself() -> None:
    thinner = StreamRateLimiter(default_interval=0.1)
    thinner.set_group(1, 10, 4)
    assert thinner.interval_us(1, ATTITUDE) == 250_000
    assert thinner.interval_us(1, m.VfrHud.id) == 100_000
    thinner.set_interval(1, ATTITUDE, 40_000)
    assert thinner.interval_us(1, ATTITUDE) == 40_000
    thinner.set_group(1, 0, 0)
    assert {thinner.interval_us(1, message_id) for message_id in STREAMED} == {STOPPED}
    thinner.set_group(1, 99, 4)
    assert thinner.interval_us(1, ATTITUDE) == STOPPED


def test_what_groups_name_is_thinned() -> None:
    assert set().union(*GROUPS.values()) == STREAMED
