from collections.abc import Iterator

import pytest

from mav_tasks.probe.steps import Steps, Wait, Walk, pause


def told(said: list[object], wait: Wait) -> Steps[None]:
    said.append((yield wait))


def test_a_step_is_told_whether_it_came_or_the_time_was_over() -> None:
    said: list[object] = []
    ready: list[int] = []

    def both() -> Steps[None]:
        yield from told(said, Wait(lambda: ready, 5.0))
        yield from told(said, Wait(lambda: False, 2.0))

    walk = Walk(both())
    walk.go_on(now=10.0)
    assert (said, walk.next_deadline()) == ([], 15.0)
    ready.append(1)
    walk.go_on(now=11.0)
    assert (said, walk.next_deadline()) == ([True], 13.0)
    walk.go_on(now=13.0)
    assert (said, walk.next_deadline(), walk.is_over) == ([True, False], None, True)


def test_an_interruption_can_be_cleared_up_after() -> None:
    cleared: list[str] = []

    def steps() -> Steps[None]:
        try:
            yield pause(100.0)
        except KeyError:
            yield pause(1.0)
            cleared.append("up")

    walk = Walk(steps())
    walk.go_on(now=0.0)
    walk.interrupt(KeyError(), now=5.0)
    assert (cleared, walk.next_deadline()) == ([], 6.0)
    walk.go_on(now=6.0)
    assert (cleared, walk.is_over) == (["up"], True)
    walk.interrupt(KeyError(), now=7.0)


def test_a_mistake_in_a_step_comes_out_and_ends_it() -> None:
    def steps() -> Iterator[Wait]:
        yield pause(1.0)
        raise ZeroDivisionError

    walk = Walk(steps())  # type: ignore[arg-type]
    walk.go_on(now=0.0)
    with pytest.raises(ZeroDivisionError):
        walk.go_on(now=1.0)
    assert walk.is_over
