"""Words that repeat themselves are said once, then counted; in virtual time."""

from mav_tasks.logs.repeats import MOST, Repeats


def told(repeats: Repeats[str], now: float) -> list[tuple[str, int, float]]:
    return [(said.what, said.more, seconds) for said, seconds in repeats.due(now=now)]


def test_what_fails_twenty_times_a_second_is_said_once_and_counted_each_half_minute() -> None:
    repeats, lines = Repeats[str](), list[tuple[float, str]]()
    for tick in range(20 * 70):
        now = tick / 20
        if repeats.is_new("disk full", "disk full", now=now):
            lines.append((now, "said"))
        lines += [
            (now, f"{more} more in {seconds:.0f} s") for _, more, seconds in told(repeats, now)
        ]
    assert lines == [(0.0, "said"), (30.0, "600 more in 30 s"), (60.0, "600 more in 30 s")]


def test_what_was_not_repeated_is_forgotten_and_said_anew() -> None:
    repeats = Repeats[str]()
    assert repeats.is_new("a", "a", now=0.0)
    assert told(repeats, 30.0) == []
    assert repeats.is_new("a", "a", now=30.5)


def test_other_words_are_said_meanwhile() -> None:
    repeats = Repeats[str]()
    assert repeats.is_new("a", "a", now=0.0)
    assert repeats.is_new("b", "b", now=0.0)
    assert not repeats.is_new("a", "a", now=0.1)
    assert told(repeats, 31.0) == [("a", 1, 31.0)]


def test_the_count_is_said_in_the_end() -> None:
    repeats = Repeats[str]()
    for now in (0.0, 1.0, 2.0):
        repeats.is_new("a", "a", now=now)
    assert [(said.what, said.more, over) for said, over in repeats.rest(now=5.0)] == [("a", 2, 5.0)]
    assert list(repeats.rest(now=6.0)) == []


def test_no_more_words_are_remembered_than_fit_and_no_count_is_lost() -> None:
    repeats = Repeats[str]()
    repeats.is_new("first", "first", now=0.0)
    repeats.is_new("first", "first", now=0.0)
    early = []
    for number in range(3 * MOST):
        repeats.is_new(number, str(number), now=1.0)
        early += told(repeats, 1.0)
    assert early == [("first", 1, 1.0)]
    assert repr(repeats) == f"Repeats({MOST} remembered)"
