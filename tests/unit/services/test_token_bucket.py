"""Token buckets."""

from mav_tasks.services.token_bucket import TokenBucket


def test_a_rate_limit_lets_a_burst_through_and_then_its_rate() -> None:
    limit = TokenBucket(rate=10.0, burst=3, now=0.0)
    passed = [n for n in range(101) if limit.take(now=n * 0.01)]
    assert passed[:3] == [0, 1, 2]
    assert len(passed) == 3 + 10  # the burst, and a second at the rate


def test_a_rate_limit_saves_up_no_more_than_its_burst() -> None:
    limit = TokenBucket(rate=10.0, burst=3, now=0.0)
    assert [limit.take(now=1000.0) for _ in range(5)] == [True, True, True, False, False]
