from functools import partial
from math import inf

from mav_tasks.engine.commit_gate import CommitGate
from mav_tasks.engine.timers import Timers


class Rig:
    """A gate, and what it let go, when and how."""

    def __init__(self) -> None:
        self.timers = Timers()
        self.gate = CommitGate(self.timers)
        self.log: list[tuple[str, str, float]] = []

    def hold(self, name: str, number: int, *, give_up_at: float) -> None:
        self.gate.hold(
            number,
            give_up_at=give_up_at,
            release=partial(self.note, name, "released"),
            give_up=partial(self.note, name, "given up"),
        )

    def handle_deadline(self, *, now: float) -> None:
        for timer in self.timers.take_due(now=now):
            timer.do(now=now)

    def note(self, name: str, what: str, *, now: float) -> None:
        self.log.append((name, what, now))


def test_an_effect_waits_for_its_event() -> None:
    rig = Rig()
    rig.hold("ack 1", 3, give_up_at=0.4)
    rig.gate.committed(2, now=0.1)
    assert rig.log == []
    rig.gate.committed(3, now=0.2)
    assert rig.log == [("ack 1", "released", 0.2)]
    assert (len(rig.gate), rig.timers.next_deadline()) == (0, inf)


def test_one_commit_releases_many_in_order() -> None:
    rig = Rig()
    for number in (1, 2, 5):
        rig.hold(f"ack {number}", number, give_up_at=0.4)
    rig.gate.committed(4, now=0.1)
    assert rig.log == [("ack 1", "released", 0.1), ("ack 2", "released", 0.1)]
    assert len(rig.gate) == 1


def test_what_waits_too_long_is_given_up_and_never_released() -> None:
    rig = Rig()
    rig.hold("ack 1", 1, give_up_at=0.4)
    rig.hold("ack 2", 2, give_up_at=0.6)
    assert rig.timers.next_deadline() == 0.4
    rig.handle_deadline(now=0.39)
    rig.handle_deadline(now=0.4)
    rig.gate.committed(2, now=0.5)
    assert rig.log == [("ack 1", "given up", 0.4), ("ack 2", "released", 0.5)]
