"""How late a packet is, told by the numbers of its sender."""

import pytest

from mav_tasks.mavlink.number_line import NumberLine


def placed(arrivals: str) -> tuple[NumberLine, list[int]]:
    """A line that has taken in numbers at times, as "10@1.5 11@2"; and where it placed them."""
    line, places = NumberLine(), []
    for arrival in arrivals.split():
        seq, _, at = arrival.partition("@")
        places.append(line.place(int(seq), now=float(at)))
    return line, places


@pytest.mark.parametrize(
    ("arrivals", "places", "lives"),
    [
        ("254@0 255@1 0@2 3@3", [254, 255, 256, 259], 0),  # beyond 255
        ("100@0 20@10 21@11 22@12 23@13", [100, 20, 21, 278, 279], 1),  # it counts from 0 again
        ("0@0 1@0.1 12@5 0@8 1@8.1", [0, 1, 12, 0, 257], 1),  # a program that is run again
        ("1@0.1 12@5 0@8 13@8.1 2@8.2", [1, 12, 0, 13, 2], 0),  # its first one was late
        ("100@0 60@10 61@10 62@10 63@10 101@10.1", [100, 60, 61, 62, 63, 101], 0),  # a burst
        ("100@0 50@10 101@10.5 51@11 102@12 52@13 103@14", [100, 50, 101, 51, 102, 52, 103], 0),
    ],
)
def test_numbers_are_counted_on(arrivals: str, places: list[int], lives: int) -> None:
    line, found = placed(arrivals)
    assert (found, line.lives) == (places, lives)
    assert line.last == max(places)


@pytest.mark.parametrize(
    ("arrivals", "seqs", "after"),
    [
        ("10@1 12@2 13@3", [11], 1.0),  # it may have left just after the one before it
        ("0@1 0@2", [0], 20.0),  # a sender that does not count is taken at its word
        ("10@1 11@2 12@3", [11], 2.0),  # the same packet had left when it came first
        ("250@1 5@2", [251, 255, 0, 4], 1.0),  # lost in between
        ("10@5 11@6", [9], 0.0),  # from before the first that came
        ("10@1", [11], 20.0),  # the newest may have left just now
    ],
)
def test_the_earliest_time_at_which_it_left(arrivals: str, seqs: list[int], after: float) -> None:
    line, _ = placed(arrivals)
    for seq in seqs:
        assert line.sent_after(line.place(seq, now=20.0), now=20.0) == after


def test_a_packet_that_seems_far_ahead_may_be_far_behind() -> None:
    line, _ = placed("10@1 12@2 112@3")
    assert (line.jumped_to(112), line.jumped_to(12)) == (True, False)
    assert not placed("112@3")[0].jumped_to(112)
