"""Sticks of the rover's own transmitter that leave neutral."""

import pytest

from mav_tasks.engine.vehicles.stick_watch import StickWatch
from mav_tasks.mavlink.messages import RcChannels


def channels(steering: int = 1500, throttle: int = 1500, *, count: int = 16) -> RcChannels:
    values = [65535] * 18
    values[0], values[2] = steering, throttle
    return RcChannels(0, count, *values, 255)  # type: ignore[call-arg]


@pytest.mark.parametrize("rest", [1500, 1000, 1520])
def test_a_throttle_that_leaves_where_it_rests_is_seen_at_the_second_message(rest: int) -> None:
    watch = StickWatch()
    assert not watch.look(channels(throttle=rest), armed=False, sent_at=1.0)
    assert not watch.look(channels(throttle=rest + 90), armed=True, sent_at=1.0)
    assert not watch.look(channels(throttle=rest + 250), armed=True, sent_at=1.0)
    assert watch.look(channels(throttle=rest + 250), armed=True, sent_at=1.0)


def test_steering_counts_too() -> None:
    watch = StickWatch()
    watch.look(channels(), armed=False, sent_at=1.0)
    watch.look(channels(steering=1300), armed=True, sent_at=1.0)
    assert watch.look(channels(steering=1300), armed=True, sent_at=1.0)


def test_what_they_show_while_it_is_disarmed_is_rest() -> None:
    watch = StickWatch()
    watch.look(channels(), armed=False, sent_at=1.0)
    watch.look(channels(throttle=1900), armed=False, sent_at=1.0)
    assert not watch.look(channels(throttle=1900), armed=True, sent_at=1.0)
    assert not watch.look(channels(throttle=1900), armed=True, sent_at=1.0)


@pytest.mark.parametrize(("throttle", "held"), [(1700, 1), (1300, -1), (1560, 0)])
def test_it_is_known_which_way_the_throttle_is_held(throttle: int, held: int) -> None:
    watch = StickWatch()
    watch.look(channels(), armed=False, sent_at=1.0)
    watch.look(channels(throttle=throttle), armed=True, sent_at=1.0)
    assert watch.throttle(now=1.0) == held
    watch.look(channels(), armed=True, sent_at=1.0)
    assert watch.throttle(now=1.0) == 0


def test_of_a_transmitter_that_has_fallen_silent_nobody_knows_what_is_held() -> None:
    watch = StickWatch()
    watch.look(channels(), armed=False, sent_at=1.0)
    watch.look(channels(throttle=1700), armed=True, sent_at=1.1)
    assert [watch.throttle(now=now) for now in (1.1, 1.5, 1.7)] == [1, 1, 0]


@pytest.mark.parametrize("absent", [channels(0, 0), channels(65535, 65535), channels(count=0)])
def test_a_rover_without_a_transmitter_has_no_sticks(absent: RcChannels) -> None:
    watch = StickWatch()
    watch.look(channels(), armed=False, sent_at=1.0)
    for _ in range(5):
        assert not watch.look(absent, armed=True, sent_at=1.0)
