"""A rover drives out of the reach of its gateway and into that of another one."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from mav_tasks.config.settings import Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED
from tests.kit.gateways.engines import Gateway
from tests.scenarios.test_gateways import Fleet

IN_TRANSIT = 3.0  # s, in which a rover that changes hands is still reached

RELEASE, REMAINDER = 54013, 1
CHANGES_NOTHING = (0, 111)  # HEARTBEAT, TIMESYNC


class Reach(Fleet):
    """A fleet whose rover drives from the reach of one gateway into that of another."""

    def becomes(self, task_id: int, state: S) -> None:
        self.until(lambda: self.task(task_id).state is state, within=60)

    def is_at(self, it: Gateway) -> bool:
        return self.database.holder(1) == it.name and self.serves(it, 1)


@pytest.fixture
def reach(tmp_path: Path) -> Iterator[Reach]:
    it = Reach(tmp_path)
    yield it
    it.check()


def test_another_gateway_that_hears_the_rover_gets_it_and_its_tasks(reach: Reach) -> None:
    ran, waits = reach.submit(5.0), reach.submit(0.5)
    reach.drives(ran)
    reach.cut(reach.first.name)
    reach.until(lambda: reach.is_at(reach.other), within=20)
    (dropped,), taken = reach.first.let_go, reach.other.got[-1]
    assert dropped[0] <= taken[0]
    assert not reach.serves(reach.first, 1)
    assert reach.stands()
    assert (reach.task(ran).state, reach.task(ran).reason) == (S.HELD, R.OUTCOME_UNKNOWN)
    assert reach.task(waits).state is S.QUEUED
    reach.run(4.5)  # words from before do not count just after a takeover
    reach.clients[reach.other.name].command(RELEASE, ran, REMAINDER)
    reach.becomes(waits, S.COMPLETED)
    assert reach.task(ran).state is S.COMPLETED
    assert abs(reach.truth.north - 5.5) < 0.1


def test_a_short_silence_changes_nothing(reach: Reach) -> None:
    task = reach.submit(5.0)
    reach.drives(task)
    reach.cut(reach.first.name)
    reach.run(4.0)
    assert reach.task(task).state is S.PAUSED
    reach.mend(reach.first.name)
    reach.becomes(task, S.COMPLETED)
    assert reach.database.takeovers == 0
    assert reach.first.let_go == []


def test_what_is_not_stored_keeps_the_rover(reach: Reach) -> None:
    reach.first.store.is_reached = False  # but its lease goes on
    reach.cut(reach.first.name)
    reach.run(12.0)  # that the rover is silent is not stored
    assert reach.database.holder(1) == reach.first.name
    reach.first.store.is_reached = True
    reach.until(lambda: reach.is_at(reach.other), within=5)


@for_each("far", [False, True])
def test_a_stop_while_the_rover_changes_hands_is_in_force_afterwards(
    tmp_path: Path, *, far: bool
) -> None:
    names = ("server", "b", "c")
    reach = Reach(tmp_path, settings=Settings(on_takeover="resume"), names=names)
    task = reach.submit(5.0)
    reach.drives(task)
    known = reach.first, reach.other
    third = next(it for it in reach.gateways.values() if it not in known)
    reach.cut(reach.first.name)
    reach.cut(third.name)
    assert reach.run_until(lambda: bool(reach.first.let_go), within=20)  # not a moment later
    assert not reach.is_at(reach.other)
    sent = reach.clients[(third if far else reach.first).name].stop()
    reach.until(lambda: reach.is_at(reach.other), within=IN_TRANSIT)
    reach.run(1.0)
    assert reach.shared.part(frozenset({1})).paused == {1: R.STOPPED}
    assert reach.task(task).state is S.KILLED
    assert sent.result == ACCEPTED
    reach.until(reach.stands, within=5)


def test_the_gateway_that_gave_it_up_sends_it_nothing_that_moves_or_asks(reach: Reach) -> None:
    task = reach.submit(8.0)
    reach.drives(task)
    reach.cut(reach.first.name)
    reach.until(lambda: reach.first.let_go, within=20)
    link = f"{reach.first.name}:vehicles"
    sent = reach.overheard(
        lambda source, target, data: (
            (source, target) == (link, "rover1") and data[7] not in CHANGES_NOTHING
        )
    )
    reach.mend(reach.first.name)
    reach.run(20.0)
    assert sent == []
