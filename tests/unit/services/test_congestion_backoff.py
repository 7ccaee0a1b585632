"""Telemetry on a way out that does not take all of it, in virtual time."""

from collections import Counter, deque

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.services.congestion_backoff import LONGEST, CongestionBackoff
from mav_tasks.services.message_interval import STREAMED, StreamRateLimiter

TICK = 0.005  # s
LOOKS = 0.05  # s between two looks at the line
STREAMS = sorted(STREAMED)[:12]
SIZE = 50  # bytes of a message


class Line:
    """A client behind so many bytes a second, and twelve streams of 25 Hz towards it."""

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self.thinner = StreamRateLimiter(default_interval=0.1)
        self.passed: list[tuple[float, int]] = []
        self.waits = 0.0  # the longest that an answer would have waited
        self._backlog = 0.0  # bytes
        self._now = 0.0

    def run(self, seconds: float) -> None:
        self.passed, self.waits = [], 0.0
        for _ in range(round(seconds / TICK)):
            step = round(self._now / TICK)
            for number, message_id in enumerate(STREAMS):
                phase = number // 2  # some streams share theirs
                if step % 8 == phase and self.thinner.passes(1, 1, message_id, now=self._now):
                    self.passed.append((self._now, message_id))
                    self._backlog += SIZE
            self._backlog = max(0.0, self._backlog - self.rate * TICK)
            self.waits = max(self.waits, self._backlog / self.rate)
            if step % round(LOOKS / TICK) == 0:
                self._look()
            self._now += TICK

    def _look(self) -> None:
        is_congested = (
            self._backlog > (0.05 if self.thinner.backoff.is_congested else 0.2) * self.rate
        )
        if is_congested is not self.thinner.backoff.is_congested:
            self.thinner.backoff.note(is_congested, now=self._now)

    @property
    def rates(self) -> list[float]:
        seconds = self.passed[-1][0] - self.passed[0][0]
        counted = Counter(message_id for _, message_id in self.passed)
        return [counted[message_id] / seconds for message_id in STREAMS]


def test_a_line_that_takes_all_changes_nothing() -> None:
    line = Line(rate=20_000)
    line.run(30)
    assert line.rates == [pytest.approx(10, rel=0.05)] * len(STREAMS)


@pytest.mark.parametrize("rate", [960, 1_920, 5_760])
def test_a_slow_line_is_used_and_no_answer_waits_long(rate: float) -> None:
    line = Line(rate)
    line.run(20)  # finds out what it takes
    line.run(60)
    assert line.waits < 0.5
    assert sum(line.rates) * SIZE > 0.6 * rate


@pytest.mark.parametrize("rate", [960, 1_920, 5_760])
def test_no_stream_starves_beside_the_others(rate: float) -> None:
    line = Line(rate)
    line.run(20)
    line.run(60)
    assert min(line.rates) > 0.6 * max(line.rates)


def test_a_line_that_became_fast_is_found_out_within_a_minute() -> None:
    line = Line(rate=1_000)
    line.run(30)
    line.rate = 20_000
    line.run(60)
    line.run(10)
    assert line.rates == [pytest.approx(10, rel=0.1)] * len(STREAMS)


def test_what_is_no_telemetry_passes_in_a_congestion() -> None:
    thinner = StreamRateLimiter(default_interval=0.1)
    thinner.backoff.note(True, now=0.0)
    assert not thinner.passes(1, 1, m.Attitude.id, now=1.0)
    for message in (m.Heartbeat, m.CommandAck, m.Statustext, m.ParamValue, m.MissionRequestInt):
        assert thinner.passes(1, 1, message.id, now=1.0)


def test_a_wish_for_everything_is_stretched_as_well() -> None:
    thinner = StreamRateLimiter(default_interval=0.1)
    thinner.set_interval(1, m.Attitude.id, 1)
    for _ in range(20):
        thinner.backoff.note(True, now=0.0)
        thinner.backoff.note(False, now=0.0)
    passed = deque(n for n in range(200) if thinner.passes(1, 1, m.Attitude.id, now=0.02 * n))
    assert len(passed) < 20


def test_the_factor_grows_at_once_and_while_it_lasts_and_shrinks_slowly() -> None:
    backoff = CongestionBackoff()
    assert backoff.factor(now=100.0) == 1.0
    backoff.note(True, now=100.0)
    assert backoff.factor(now=100.0) == pytest.approx(1.5)
    assert backoff.factor(now=102.0) == pytest.approx(2.25)
    backoff.note(False, now=102.0)
    assert backoff.factor(now=103.0) == pytest.approx(2.25 * 0.951, rel=1e-3)
    assert backoff.factor(now=200.0) == 1.0
    backoff.note(True, now=300.0)
    assert backoff.factor(now=1e9) == LONGEST
