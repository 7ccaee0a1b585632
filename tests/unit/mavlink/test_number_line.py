"""How late a packet is, told by the numbers of its sender."""

from mav_tasks.mavlink.number_line import NumberLine


def line_of(*arrivals: tuple[int, float]) -> NumberLine:
    """Return a line that has taken in these numbers at these times."""
    line = NumberLine()
    for seq, at in arrivals:
        line.place(seq, now=at)
    return line


def test_numbers_are_counted_on_beyond_255() -> None:
    line = line_of((254, 0.0), (255, 1.0))
    assert line.place(0, now=2.0) == 256
    assert line.place(3, now=3.0) == 259
    assert line.last == 259


def test_one_that_was_overtaken_may_have_left_just_after_the_one_before_it() -> None:
    line = line_of((10, 1.0), (12, 2.0), (13, 3.0))
    number = line.place(11, now=20.0)
    assert number == 11
    assert line.sent_after(number, now=20.0) == 1.0
    assert line.last == 13


def test_a_sender_that_does_not_count_is_taken_at_its_word() -> None:
    line = line_of((0, 1.0), (0, 2.0))
    assert line.sent_after(line.place(0, now=20.0), now=20.0) == 20.0


def test_the_same_packet_again_had_left_when_it_came_first() -> None:
    line = line_of((10, 1.0), (11, 2.0), (12, 3.0))
    assert line.sent_after(line.place(11, now=20.0), now=20.0) == 2.0


def test_what_was_lost_in_between_may_have_left_after_what_came_before_it() -> None:
    line = line_of((250, 1.0), (5, 2.0))
    for seq in (251, 255, 0, 4):
        assert line.sent_after(line.place(seq, now=9.0), now=9.0) == 1.0


def test_who_was_there_before_the_first_that_came_may_have_said_it_at_any_time() -> None:
    line = line_of((10, 5.0), (11, 6.0))
    assert line.sent_after(line.place(9, now=7.0), now=7.0) == 0.0


def test_a_packet_that_seems_far_ahead_may_be_far_behind() -> None:
    line = line_of((10, 1.0), (12, 2.0), (112, 3.0))
    assert line.jumped_to(112)
    assert not line.jumped_to(12)
    assert not line_of((112, 3.0)).jumped_to(112)


def test_the_newest_may_have_left_just_now() -> None:
    line = line_of((10, 1.0))
    assert line.sent_after(line.place(11, now=5.0), now=5.0) == 5.0


def test_a_sender_that_counts_from_0_again_is_believed_after_a_while() -> None:
    line = line_of((100, 0.0))  # and whose first packets are lost
    assert line.place(20, now=10.0) == 20
    assert line.place(21, now=11.0) == 21
    number = line.place(22, now=12.0)
    assert number > 100
    assert line.place(23, now=13.0) == number + 1


def test_a_program_that_is_run_again_is_believed_with_its_second_packet() -> None:
    line = line_of((0, 0.0), (1, 0.1), (12, 5.0))
    assert line.place(0, now=8.0) == 0
    assert line.place(1, now=8.1) == 257
    assert (line.last, line.lives) == (257, 1)


def test_its_first_packet_may_be_late_without_that() -> None:
    line = line_of((1, 0.1), (12, 5.0))
    assert line.place(0, now=8.0) == 0
    assert line.place(13, now=8.1) == 13
    assert line.place(2, now=8.2) == 2
    assert line.lives == 0


def test_a_burst_of_late_ones_is_none_that_begins_anew() -> None:
    line = line_of((100, 0.0))
    assert [line.place(seq, now=10.0) for seq in (60, 61, 62, 63)] == [60, 61, 62, 63]
    assert line.place(101, now=10.1) == 101


def test_late_ones_between_newer_ones_are_none_that_begins_anew() -> None:
    line = line_of((100, 0.0))
    for number in range(5):
        assert line.place(50 + number, now=10.0 + number) == 50 + number
        line.place(101 + number, now=10.5 + number)
    assert line.last == 105
