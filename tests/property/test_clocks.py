"""Random nets between us and a vehicle's clock: a restart is seen, and none where there is none."""

from itertools import pairwise

from hypothesis import assume, given
from hypothesis import strategies as st

from mav_tasks.engine.vehicles.sender_clock import OVERFLOW, Heard, SenderClock
from mav_tasks.mavlink.messages import Attitude, LocalPositionNed

RATE = 10  # Hz of each kind
SECONDS = 40
COMES_UP = st.floats(0.2, 10.0)  # s in which a restarting vehicle says nothing
#: s that a vehicle was up: a minute, a day, on either side of half an overflow and of a whole one
UP = st.one_of(
    st.floats(60, 86_400),
    st.floats(24.8 * 86_400, 25 * 86_400),
    st.floats(OVERFLOW / 1000 - SECONDS, OVERFLOW / 1000 + SECONDS),
    st.floats(49 * 86_400, 120 * 86_400),
)
DELAYS = st.lists(st.floats(0, 4), min_size=1, max_size=60)  # s, of one message after the other
COPIES = st.lists(st.tuples(st.integers(0, 2 * RATE * SECONDS - 1), st.floats(0, 20)), max_size=60)

Said = tuple[float, int, int]  # when it is sent, ms, kind


def says(*, since: float, until: float, up: float) -> list[Said]:
    """Return what a vehicle sends that has been up for so long when it begins."""
    count = round((until - since) * RATE)
    times = [since + number / RATE for number in range(count)]
    return [(at, round(1000 * (up + at - since)), kind) for at in times for kind in (0, 1)]


def message(ms: int, kind: int) -> Attitude | LocalPositionNed:
    return (Attitude if kind else LocalPositionNed)(ms % OVERFLOW, 0, 0, 0, 0, 0, 0)


def over_a_net(
    sent: list[Said], delays: list[float], copies: list[tuple[int, float]]
) -> list[tuple[float, float, int, int]]:
    """Return what arrives: when, when it was sent, ms, kind; in the order in which it does."""
    came = [
        (at + delays[number % len(delays)], at, ms, kind)
        for number, (at, ms, kind) in enumerate(sent)
    ]
    again = [came[number % len(came)] for number, _ in copies]
    came += [(each[0] + late, *each[1:]) for each, (_, late) in zip(again, copies, strict=True)]
    end = sent[-1][0]
    return sorted(each for each in came if each[0] < end + 4.0)  # who says nothing is lost


@given(up=UP, delays=DELAYS, copies=COPIES)
def test_no_net_makes_a_restart_where_there_is_none(
    up: float, delays: list[float], copies: list[tuple[int, float]]
) -> None:
    assume(up % (OVERFLOW / 1000) > 60)  # one that has overflowed just now looks new
    clock = SenderClock()
    newest = -1.0
    for now, sent_at, ms, kind in over_a_net(says(since=0, until=SECONDS, up=up), delays, copies):
        heard = clock.hear(message(ms, kind), now=now)
        assert heard is not Heard.RESTART
        if heard is Heard.NEWS:
            # nothing is younger than it is by more than the quickest of the last 20 s was delayed
            assert clock.sent_at(ms % OVERFLOW, now=now) <= sent_at + max(delays) + 0.01
            newest = max(newest, sent_at)
    assert newest >= SECONDS - 1 / RATE - 1e-6


@given(up=UP, delays=DELAYS, copies=COPIES, silent=COMES_UP, booting=st.floats(0, 10))
def test_a_restart_is_seen_within_a_second_of_its_first_three_messages(
    up: float, delays: list[float], copies: list[tuple[int, float]], silent: float, booting: float
) -> None:
    # about an overflow a clock that begins anew is one that has overflowed: seen 5 s later, or not
    assume(30 < (up + SECONDS) % (OVERFLOW / 1000) < OVERFLOW / 1000 - 17)
    booting = min(booting, silent)  # its clock goes while it says nothing yet
    before = over_a_net(says(since=0, until=SECONDS, up=up), delays, copies)
    begin = SECONDS + silent
    after = over_a_net(says(since=begin, until=begin + 8, up=booting), delays, [])
    clock = SenderClock()
    third = sorted(now for now, *_ in after)[2]
    seen = None
    for now, _, ms, kind in sorted([*before, *after]):
        if seen is None and clock.hear(message(ms, kind), now=now) is Heard.RESTART:
            seen = now
    assert seen is not None
    assert seen <= third + 1.0


@given(up=UP, delays=DELAYS)
def test_time_goes_on_over_an_overflow(up: float, delays: list[float]) -> None:
    clock = SenderClock()
    for now, _, ms, kind in over_a_net(says(since=0, until=SECONDS, up=up), delays, []):
        clock.hear(message(ms, kind), now=now)
    stamps = [round(1000 * up) + step for step in range(0, 1000 * SECONDS, 1000)]
    made = [clock.sent_at(ms % OVERFLOW, now=SECONDS + 4.0) for ms in stamps[-20:]]
    assert all(later - earlier > 0.99 for earlier, later in pairwise(made[:-5]))
