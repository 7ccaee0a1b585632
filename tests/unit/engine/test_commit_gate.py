from functools import partial
from math import inf

from mav_tasks.engine.commit_gate import CommitGate
from mav_tasks.engine.timers import Timers
from mav_tasks.tasks.registry import TaskRegistry

WITHIN = 0.4  # s


class Rig:
    """A gate, and what it let go, when and how."""

    def __init__(self) -> None:
        self.timers = Timers()
        self.registry = TaskRegistry()
        self.gate = CommitGate(self.registry, self.timers, within=WITHIN)
        self.log: list[tuple[str, str, float]] = []

    def hold(self, name: str, number: int, *, now: float = 0.0) -> None:
        self.registry.recorded = number
        self.gate.hold(partial(self.accept, name), partial(self.give_up, name), now=now)

    def handle_deadline(self, *, now: float) -> None:
        for timer in self.timers.take_due(now=now):
            timer.do(now=now)

    def accept(self, name: str, *, now: float) -> None:
        self.log.append((name, "released", now))

    def give_up(self, name: str, *, now: float) -> None:
        self.log.append((name, "given up", now))


def test_a_value_waits_for_its_event() -> None:
    rig = Rig()
    rig.hold("ack 1", 3)
    rig.gate.committed(2, now=0.1)
    assert rig.log == []
    rig.gate.committed(3, now=0.2)
    assert rig.log == [("ack 1", "released", 0.2)]
    assert (len(rig.gate), rig.timers.next_deadline()) == (0, inf)


def test_what_waits_for_nothing_is_carried_out_at_once() -> None:
    rig = Rig()
    rig.registry.durable = 3
    rig.hold("ack 1", 3, now=0.1)
    assert rig.log == [("ack 1", "released", 0.1)]


def test_one_commit_releases_many_in_order() -> None:
    rig = Rig()
    for number in (1, 2, 5):
        rig.hold(f"ack {number}", number)
    rig.gate.committed(4, now=0.1)
    assert rig.log == [("ack 1", "released", 0.1), ("ack 2", "released", 0.1)]
    assert len(rig.gate) == 1


def test_what_waits_too_long_is_given_up_and_never_released() -> None:
    rig = Rig()
    rig.hold("ack 1", 1)
    rig.hold("ack 2", 2, now=0.2)
    assert rig.timers.next_deadline() == WITHIN
    rig.handle_deadline(now=0.39)
    rig.handle_deadline(now=0.4)
    rig.gate.committed(2, now=0.5)
    assert rig.log == [("ack 1", "given up", 0.4), ("ack 2", "released", 0.5)]
