"""Lines that are too long for a terminal are wrapped at words."""

from mav_tasks.cli.output import wrapped

LINE = "2026-11-21T10:00:00.250Z rover 1: task 3 submitted: move 2 m, by 255/190@10.0.0.2:14550\n"


def test_a_line_is_wrapped_at_words_and_indented() -> None:
    assert wrapped(LINE, 48) == (
        "2026-11-21T10:00:00.250Z rover 1: task 3\n"
        "    submitted: move 2 m, by\n"
        "    255/190@10.0.0.2:14550\n"
    )


def test_a_line_that_fits_is_left_alone() -> None:
    assert wrapped(LINE, len(LINE) - 1) == LINE
    assert wrapped(LINE, len(LINE) - 2).count("\n") == 2


def test_no_word_is_broken_even_if_the_terminal_is_narrower() -> None:
    words = LINE.split()
    assert wrapped(LINE, 5).split() == words
    assert max(map(len, wrapped(LINE, 5).splitlines())) < 30
