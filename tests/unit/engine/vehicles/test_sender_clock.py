"""What a vehicle's own clock says: what is news, what is old, what is a restart; and how old."""

import pytest

from mav_tasks.engine.vehicles.sender_clock import OVERFLOW, Heard, SenderClock
from mav_tasks.mavlink.messages import Attitude, GlobalPositionInt, LocalPositionNed

DAY = 86_400_000  # ms


def position(ms: int) -> LocalPositionNed:
    return LocalPositionNed(ms % OVERFLOW, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def attitude(ms: int) -> Attitude:
    return Attitude(ms % OVERFLOW, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def drives(*, up: int, until: float = 60.0) -> SenderClock:
    """Return the clock of a vehicle that was up for so many ms at 0 s, and is heard at 20 Hz."""
    clock = SenderClock()
    for number in range(round(until * 20) + 1):
        assert clock.hear(position(up + 50 * number), now=number / 20) is Heard.NEWS
        assert clock.hear(attitude(up + 50 * number), now=number / 20) is Heard.NEWS
    return clock


@pytest.mark.parametrize("days", [0.001, 1, 24, 25, 30, 49, 49.71, 60])
def test_a_restart_is_seen_at_its_first_message_however_long_the_vehicle_was_up(
    days: float,
) -> None:
    clock = drives(up=round(days * DAY))
    assert clock.hear(position(500), now=61.5) is Heard.RESTART


@pytest.mark.parametrize("uptime", [60_100, 61_000, 90_000])
def test_a_restart_is_seen_after_a_silence_longer_than_it_was_up_before(uptime: int) -> None:
    clock = drives(up=0)
    assert clock.hear(position(uptime), now=60.0 + uptime / 1000 + 26.0) is Heard.RESTART


@pytest.mark.parametrize("days", [0.001, 1, 25, 49.71])
@pytest.mark.parametrize("lost", [0.0, 1.0, 24.0])
def test_a_vehicle_that_is_heard_after_a_long_silence_goes_on(days: float, lost: float) -> None:
    """Also if its clock is slow: 24 s are what the slowest lose in two days."""
    clock = drives(up=round(days * DAY))
    ms = round(days * DAY + 60_000 + 3_600_000 - 1000 * lost)
    assert clock.hear(position(ms), now=60.0 + 3_600.0) is Heard.NEWS


def test_a_vehicle_whose_clock_stood_still_has_not_restarted() -> None:
    """As that of a simulator that was suspended."""
    clock = drives(up=DAY)
    assert clock.hear(position(DAY + 60_100), now=60.0 + 600.0) is Heard.NEWS


def test_a_vehicle_that_repeats_its_messages_for_long_has_not_restarted() -> None:
    clock = drives(up=0)
    for second in range(1, 41):
        assert clock.hear(position(60_000), now=60.0 + second) is Heard.OLD
    assert clock.hear(position(60_050), now=101.0) is Heard.NEWS


@pytest.mark.parametrize("late", [1.1, 2.0, 5.0, 20.0])
@pytest.mark.parametrize("days", [0.0, 1, 25, 49.71])
def test_one_that_comes_again_late_is_old(days: float, late: float) -> None:
    clock = drives(up=round(days * DAY))
    again = round(days * DAY + 60_000 - 1000 * late)
    for number in range(3):
        now = 60.01 + 0.05 * number
        assert clock.hear(position(again), now=now) is Heard.OLD
        assert clock.hear(position(round(days * DAY + 60_000 + 50 * (number + 1))), now=now + 0.04)


def test_a_clock_that_overflows_goes_on() -> None:
    clock = drives(up=OVERFLOW - 30_000)
    assert clock.hear(position(OVERFLOW + 30_050), now=60.05) is Heard.NEWS
    assert clock.booted_at(now=60.05) == pytest.approx(30.0 - OVERFLOW / 1000)


def test_what_was_overtaken_where_the_clock_overflows_is_old() -> None:
    clock = SenderClock()
    clock.hear(position(OVERFLOW + 16), now=0.0)
    assert clock.hear(position(OVERFLOW - 16), now=0.01) is Heard.OLD
    assert clock.hear(position(OVERFLOW - 5_000), now=0.02) is Heard.OLD


def test_what_each_kind_of_message_has_said_is_old() -> None:
    clock = drives(up=0)
    assert clock.hear(position(60_050), now=60.05) is Heard.NEWS
    assert clock.hear(position(60_050), now=60.06) is Heard.OLD
    assert clock.hear(attitude(60_050), now=60.07) is Heard.NEWS
    assert clock.hear(attitude(60_010), now=60.08) is Heard.OLD
    assert clock.hear(GlobalPositionInt(60_010, 0, 0, 0, 0, 0, 0, 0, 0), now=60.08) is Heard.NEWS


def test_another_clock_that_goes_on_is_a_restart_after_a_while_though_it_is_no_new_one() -> None:
    """One that was replaced, or whose clock does not begin at 0, is not passed over for good."""
    clock = drives(up=DAY)
    heard = [clock.hear(position(DAY // 2 + 50 * n), now=61 + n / 20) for n in range(120)]
    assert heard.index(Heard.RESTART) == 101


def test_what_is_made_now_is_made_when_it_comes() -> None:
    clock = drives(up=1234)
    assert clock.sent_at(1234 + 60_050, now=60.05) == 60.05
    assert clock.sent_at(1234 + 60_050, now=60.051) == 60.051


def test_what_was_under_way_for_longer_than_others_is_older() -> None:
    clock = drives(up=1234)
    assert clock.sent_at(1234 + 60_050, now=62.05) == pytest.approx(60.05)


def test_a_clock_that_nothing_is_known_of_makes_nothing_old() -> None:
    assert SenderClock().sent_at(77, now=5.0) == 5.0


def test_a_delay_from_the_start_shows_in_an_exchange() -> None:
    clock = SenderClock()
    for number in range(100):
        clock.hear(position(50 * number), now=2.0 + number / 20)
    assert clock.sent_at(4_950, now=6.95) == 6.95
    clock.offset.exchange(6.0, 6.001, now=8.0)  # asked and answered in 2 s
    assert clock.sent_at(5_000, now=8.0) == pytest.approx(5.1, abs=0.01)


def test_the_way_there_of_a_quick_link_is_not_counted_as_age() -> None:
    clock = SenderClock()
    for number in range(100):
        clock.hear(position(50 * number), now=0.08 + number / 20)
    clock.offset.exchange(4.9, 4.98, now=5.06)
    assert clock.sent_at(5_000, now=5.08) == pytest.approx(5.0)


def test_an_exchange_with_another_clock_says_nothing() -> None:
    clock = drives(up=0)
    clock.offset.exchange(60.0, 1.7e9, now=60.01)
    assert clock.sent_at(60_050, now=60.05) == 60.05


@pytest.mark.parametrize("rate", [0.88, 0.9, 0.9999, 1.0001, 1.1])
def test_a_simulators_clock_that_goes_wrong_is_followed_by_exchanges(rate: float) -> None:
    clock, oldest = SenderClock(), 0.0
    for number in range(1200):
        now = number / 20
        clock.hear(position(round(1000 * rate * now)), now=now)
        if number % 20 == 0:
            clock.offset.exchange(now - 0.002, rate * (now - 0.001), now=now)
        oldest = max(oldest, now - clock.sent_at(round(1000 * rate * now), now=now))
    assert oldest < 0.15


@pytest.mark.parametrize("rate", [0.9999, 1.0001])
def test_a_real_clock_is_followed_without_exchanges(rate: float) -> None:
    clock = SenderClock()
    for number in range(20 * 600):
        now = number / 20
        clock.hear(position(round(1000 * rate * now)), now=now)
        assert now - clock.sent_at(round(1000 * rate * now), now=now) < 0.01


@pytest.mark.parametrize("catches_up", [False, True])
def test_a_simulator_that_stood_still_looks_old_for_two_seconds_at_the_most(
    catches_up: bool,
) -> None:
    """It is neither a restart, nor late for good."""
    clock = drives(up=0)
    told = 60.0
    for number in range(1, 200):
        now = 70.0 + number / 20
        told += 0.05 * (2 if catches_up and told < now - 0.1 else 1)
        assert clock.hear(position(round(1000 * told)), now=now) is Heard.NEWS
        if number % 20 == 0:
            clock.offset.exchange(now - 0.002, told, now=now)
        if number > 40:
            assert now - clock.sent_at(round(1000 * told), now=now) < 0.1
