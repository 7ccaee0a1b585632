from mav_tasks.services.retry import Retry


def sendings(retry: Retry, times: list[float]) -> list[float]:
    """When a retry sends, if looked at at these times."""
    sent = []
    for now in times:
        if retry.is_due(now):
            retry.note_sent(now)
            sent.append(now)
    return sent


def test_it_sends_at_once_and_then_at_its_interval_until_it_is_over() -> None:
    retry = Retry.starting(now=10.0, interval=0.25, give_up_after=1.0)
    times = [10.0 + 0.125 * n for n in range(12)]
    assert sendings(retry, times) == [10.0, 10.25, 10.5, 10.75]
    assert (retry.sent, retry.is_over(10.999), retry.is_over(11.0)) == (4, False, True)


def test_a_late_sending_moves_the_next() -> None:
    retry = Retry.starting(now=0.0, interval=0.25, give_up_after=1.0)
    assert sendings(retry, [0.1, 0.3, 0.35, 0.6]) == [0.1, 0.35, 0.6]


def test_its_deadline_is_the_next_sending_or_the_end() -> None:
    retry = Retry.starting(now=0.0, interval=0.4, give_up_after=1.0)
    deadlines = []
    for now in (0.0, 0.4, 0.8):
        deadlines.append(retry.next_deadline())
        retry.note_sent(now)
    assert [*deadlines, retry.next_deadline()] == [0.0, 0.4, 0.8, 1.0]
