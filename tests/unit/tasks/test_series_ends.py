"""A STOP, a cleared queue or a cancel ends a series that is between two of its runs."""

from collections.abc import Callable

import pytest

from mav_tasks.settings import Settings
from mav_tasks.tasks.events import TaskModified, VehicleNoted
from mav_tasks.tasks.fleet import Fleet
from mav_tasks.tasks.goal import Move
from mav_tasks.tasks.lifecycle import WAITING
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.pending_tasks import PendingTasks
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.repetition import repeating
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Draft, Task, Terms
from mav_tasks.tasks.vehicle_tasks import VehicleTasks
from tests.unit.tasks.samples import SOMEBODY

OFFSET = 1.79e9
ROVER = 1


class Series:
    """A vehicle whose task repeats each hour; its first run is over. No id is left for the next."""

    def __init__(self) -> None:
        self.registry = TaskRegistry()
        self.registry.ids.share()
        self.registry.ids.grant(1, 1)
        self.room = PendingTasks(self.registry, Settings())
        self.room.set_wall_offset(OFFSET, now=100.0)
        self.vehicle = VehicleTasks(ROVER, self.registry, self.room, Settings())
        task = self.room.submit(Draft(ROVER, 54000, Move(1.0), SOMEBODY, Terms()), now=100.0)
        terms = repeating(task, "3600", now=100.0, wall_offset=OFFSET)
        self.room.modify(task, terms, actor="client", now=100.0)
        self.room.leave(self.registry[task.id])
        for state in (S.STARTING, S.EXECUTING, S.COMPLETED):
            self.registry.change(task.id, state, reason=R.NONE, actor="server", now=110.0)
        self.room.ended(task.id, now=110.0)
        self.first = task.id

    def plan(self) -> list[Task]:
        """Grant ids, and return the tasks after the first run."""
        self.registry.ids.grant(50, 10)
        self.room.plan_runs(now=112.0)
        return [task for task in self.registry.all() if task.id != self.first]


def test_without_an_end_the_next_run_is_planned_once_there_is_an_id() -> None:
    series = Series()
    series.room.plan_runs(now=110.0)
    assert [task.state for task in series.plan()] == [S.SCHEDULED]


@pytest.mark.parametrize(
    "end",
    [
        lambda it: it.vehicle.stop(clear=False, actor="operator", now=111.0),
        lambda it: it.vehicle.stop(clear=True, actor="operator", now=111.0),
        lambda it: it.vehicle.clear(begun_too=False, actor="operator", now=111.0),
    ],
    ids=["stop", "stop and clear", "clear"],
)
def test_what_ends_a_series_ends_it_between_two_runs(end: Callable[[Series], None]) -> None:
    series = Series()
    series.room.plan_runs(now=110.0)
    end(series)
    events = series.registry.take_events()
    (stored,) = [
        each for each in events if isinstance(each, TaskModified) and not each.terms.repeat
    ]
    assert (stored.task_id, stored.actor) == (series.first, "operator")
    assert series.plan() == []

    restored = TaskRegistry()  # a restart, or another gateway
    restored.restore(series.registry.all())
    assert not restored.unplanned


def test_a_stop_in_the_turn_in_which_a_run_ends_ends_its_series() -> None:
    series = Series()
    series.vehicle.stop(clear=False, actor="operator", now=110.0)
    assert series.plan() == []


def test_a_killed_run_says_once_that_its_series_has_ended() -> None:
    series = Series()
    (run,) = series.plan()
    series.registry.take_events()
    series.vehicle.stop(clear=False, actor="operator", now=120.0)
    series.room.plan_runs(now=120.0)
    texts = [each.text for each in series.registry.take_events() if isinstance(each, VehicleNoted)]
    assert [f"will not repeat task {run.id}" in words for words in texts] == [True]


@pytest.mark.parametrize("between", [False, True])
@pytest.mark.parametrize(
    ("halted", "repeats"),
    [((R.STOPPED, 113.0), False), ((R.STOPPED, 99.0), True), ((R.OPERATOR, 113.0), True)],
    ids=["by the STOP", "not by an older one", "nor by a pause"],
)
def test_after_a_crash_that_kept_the_stop_alone_its_series_have_ended(
    halted: tuple[R, float], *, repeats: bool, between: bool
) -> None:
    """On a full disk the STOP is in the halt record only, and the end of the series is not."""
    series = Series()
    if not between:
        series.plan()
    registry = TaskRegistry()
    registry.ids.share()
    fleet = Fleet(registry, Settings())
    stored = Restored(
        tasks=series.registry.all(),
        paused={ROVER: R.STOPPED},
        halted={ROVER: halted},
        wall_offset=OFFSET,
        gateway="a",
    )
    fleet.restore(stored, now=114.0)
    registry.ids.grant(70, 10)
    fleet.room.plan_runs(now=114.0)
    runs = [task for task in registry.all() if task.id != series.first and task.state in WAITING]
    assert [bool(task.terms.repeat) for task in runs] == [True] * repeats
    assert fleet.of(ROVER).paused is R.STOPPED
