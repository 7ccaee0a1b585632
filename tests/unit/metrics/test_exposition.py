"""The text of metrics, read back by another implementation."""

from math import inf, nan

from mav_tasks.histogram import Distribution, Histogram
from mav_tasks.metrics.exposition import Family, lines_of
from tests.kit.scraped import check_with_promtool, figure, figures_of

GAUGE = Family("a_gauge", "gauge", 'A "gauge" with a \\ and\na new line.', ("name",))
SECONDS = Family("a_time_seconds", "histogram", "A time.", ("vehicle",))


def text_of(*lines: str) -> str:
    return "".join(f"{line}\n" for line in lines)


def test_numbers_and_labels_are_read_back_as_they_were() -> None:
    names = ("plain", 'quo"ted', "back\\slash", "new\nline", "ünïcode", "{a=b, c}", "")
    values = (0.0, 1e-9, 123456789.123, -2.5, inf, -inf, 1e300)
    samples = [((name,), value) for name, value in zip(names, values, strict=True)]
    text = text_of(*lines_of(GAUGE, samples))
    found = figures_of(text)
    assert {name: figure(found, "a_gauge", name=name) for name in names} == dict(
        zip(names, values, strict=True)
    )
    check_with_promtool(text)


def test_a_number_that_is_unknown_is_none() -> None:
    (*_, line) = lines_of(GAUGE, [(("x",), nan)])
    assert line == 'a_gauge{name="x"} NaN'


def test_a_histogram_counts_what_is_at_most_the_bound() -> None:
    histogram = Histogram((0.1, 0.25, 1.0))
    values = (0.05, 0.1, 0.10001, 0.25, 0.9, 1.0, 7.0)
    for value in values:
        histogram.note(value)
    text = text_of(*lines_of(SECONDS, [(("1",), histogram.figures())]))
    found = figures_of(text)

    def up_to(bound: str) -> float:
        return figure(found, "a_time_seconds_bucket", vehicle="1", le=bound)

    assert [up_to(bound) for bound in ("0.1", "0.25", "1.0", "+Inf")] == [2, 4, 6, 7]
    assert figure(found, "a_time_seconds_count", vehicle="1") == 7
    assert figure(found, "a_time_seconds_sum", vehicle="1") == sum(values)
    check_with_promtool(text)


def test_figures_once_taken_stay_as_they_are() -> None:
    histogram = Histogram((1.0,))
    histogram.note(0.5)
    taken = histogram.figures()
    histogram.note(2.0)
    assert taken == Distribution((1.0,), (1, 0), 0.5)
    assert (taken.count, histogram.figures().count) == (1, 2)


def test_a_family_without_samples_has_no_lines() -> None:
    assert list(lines_of(GAUGE, [])) == []
