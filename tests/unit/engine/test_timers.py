"""The one heap of timers: who comes when, and in which order."""

from functools import partial
from math import inf
from random import Random

from mav_tasks.engine.timers import SPARE, Timer, Timers, Turn


class Rig:
    """Timers that write down who came."""

    def __init__(self) -> None:
        self.timers = Timers()
        self.came: list[str] = []

    def timer(self, name: str, turn: Turn = Turn.VEHICLES, *, number: int | None = None) -> Timer:
        return self.timers.timer(turn, partial(self.note, name), number=number)

    def note(self, name: str, *, now: float) -> None:
        self.came.append(f"{name} {now:g}")

    def come(self, *, now: float) -> list[str]:
        self.came = []
        for timer in self.timers.take_due(now=now):
            timer.do(now=now)
        return self.came


def test_one_that_was_never_set_never_comes() -> None:
    rig = Rig()
    rig.timer("a")
    assert (rig.timers.next_deadline(), rig.come(now=1e9)) == (inf, [])


def test_it_comes_once_and_not_before_its_time() -> None:
    rig = Rig()
    timer = rig.timer("a")
    timer.set(2.0)
    assert (rig.timers.next_deadline(), rig.come(now=1.9)) == (2.0, [])
    assert (rig.come(now=2.0), timer.at, rig.timers.next_deadline()) == (["a 2"], inf, inf)
    assert rig.come(now=3.0) == []


def test_put_off_it_comes_later_and_brought_forward_sooner() -> None:
    rig = Rig()
    timer = rig.timer("a")
    for at in (2.0, 5.0):
        timer.set(at)
    assert (rig.come(now=4.0), rig.timers.next_deadline()) == ([], 5.0)
    timer.set(3.0)
    timer.bring_forward(3.5)
    assert rig.timers.next_deadline() == 3.0
    timer.bring_forward(2.5)
    assert (rig.come(now=4.0), rig.come(now=9.0)) == (["a 4"], [])


def test_called_off_it_does_not_come_and_set_again_to_the_same_time_it_does() -> None:
    rig = Rig()
    timer = rig.timer("a")
    timer.set(2.0)
    timer.set(inf)
    assert (rig.timers.next_deadline(), rig.come(now=2.0)) == (inf, [])
    timer.set(2.0)
    assert rig.come(now=2.0) == ["a 2"]
    timer.set(2.0)
    assert (rig.come(now=2.0), rig.come(now=2.0)) == (["a 2"], [])


def test_of_those_that_are_due_turn_counts_first_then_time_then_number() -> None:
    rig = Rig()
    for name, turn, number, at in (
        ("reports", Turn.REPORTS, 0, 1.0),
        ("rover 2", Turn.VEHICLES, 2, 2.0),
        ("rover 1", Turn.VEHICLES, 1, 2.0),
        ("rover 3", Turn.VEHICLES, 3, 1.5),
        ("link", Turn.LINKS, 0, 2.0),
    ):
        rig.timer(name, turn, number=number).set(at)
    assert rig.come(now=2.0) == ["link 2", "rover 3 2", "rover 1 2", "rover 2 2", "reports 2"]


def test_a_rhythm_goes_on_by_itself_and_makes_no_burst_when_late() -> None:
    rig = Rig()
    rhythm = rig.timers.rhythm(Turn.LINKS, partial(rig.note, "beat"), period=1.0, now=5.0)
    times = [5.0, 5.9, 6.0, 7.25, 8.0, 20.0, 20.4, 20.5]
    assert [bool(rig.come(now=now)) for now in times] == [1, 0, 1, 1, 1, 1, 0, 1]
    rhythm.set(inf)
    assert rig.come(now=100.0) == []


def test_it_says_of_nothing_that_it_comes_before_it_does() -> None:
    """Held against the plain way, at random: to ask each timer."""
    random, rig, now = Random(1), Rig(), 0.0
    timers = [rig.timer(str(number)) for number in range(9)]
    plain = [inf] * len(timers)
    for _ in range(20_000):
        number, at = random.randrange(len(timers)), random.choice([inf, now + random.randrange(9)])
        timers[number].set(at)
        plain[number] = at
        assert rig.timers.not_before <= min(plain)
        if random.random() < 0.5:
            assert rig.timers.next_deadline() == min(plain)
        if random.random() < 0.3:
            now += random.choice([0.0, 1.0])
            due = sorted((at, number) for number, at in enumerate(plain) if at <= now)
            assert rig.come(now=now) == [f"{number} {now:g}" for _, number in due]
            plain = [at if at > now else inf for at in plain]
    assert len(rig.timers.heap) <= 4 * SPARE


def test_what_is_set_again_and_again_leaves_little_behind() -> None:
    rig = Rig()
    timer = rig.timer("a")
    for step in range(100_000):
        now = float(step)
        timer.set(now + 1e6)
        timer.set(now)
        assert rig.come(now=now) == [f"a {now:g}"]
    assert len(rig.timers.heap) <= 2 * SPARE
