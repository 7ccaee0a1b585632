"""What every durable store does, on each kind of database."""

import sys
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, given, settings

from mav_tasks.basics.errors import StoreError
from mav_tasks.config.settings import Retention
from mav_tasks.engine.inputs import Committed
from mav_tasks.kinds import Pose
from mav_tasks.store import Which, kind_of, open_store
from mav_tasks.tasks.events import (
    Event,
    ParameterSet,
    PlanStored,
    QueueContinued,
    QueuePaused,
    ServerStopped,
    SignaturesSeen,
    SignatureTime,
    SubmissionRefused,
    TaskAdvanced,
    TaskModified,
    TaskProgressed,
    TaskSubmitted,
    TaskWithdrawn,
    VehicleIdentified,
    VehicleSeen,
    VehicleSpeedSet,
)
from mav_tasks.tasks.goal import Goal
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import MAX_TASK_ID, Progress, TaskId, Terms
from tests.kit.databases import locked, tables
from tests.unit.store.samples import (
    OFFSET,
    TASK_MOVE,
    cancelled,
    changed,
    keep,
    loaded,
    opened,
    submitted,
    wait_for,
    wait_for_failure,
)

# On disk a time has some nanoseconds less: these lose nothing.
st.register_type_strategy(float, st.integers(-(2**20), 2**20).map(lambda n: n / 8))
st.register_type_strategy(int, st.integers(0, 2**20))
st.register_type_strategy(str, st.text(st.characters(min_codepoint=32, max_codepoint=0x2FFF)))
FIRST, SECOND = (SignatureTime("key", link, 1, 1, 7) for link in (0, 1))
#: the others only change what the next life knows
JOURNALLED = [each for each in get_args(Event) if each not in (TaskProgressed, SignaturesSeen)]


#: by the kind of place: what makes the schema before of this one; last: the one before that
OLDER = {
    True: (
        "DROP INDEX of_kind",
        "CREATE INDEX of_no_task ON journal (number)",
        "UPDATE versions SET version = 7",
        "UPDATE versions SET version = version - 2",
    ),
    False: ("DROP INDEX of_kind", "PRAGMA user_version = 11", "PRAGMA user_version = 10"),
}


def test_a_store_of_the_schema_before_is_converted_and_an_older_one_refused(place: str) -> None:
    with opened(place) as store:
        keep(store, submitted(1))
    *before, older = OLDER["://" in place]
    with tables(place) as file:
        for statement in before:
            file.execute(statement)
    with closing(kind_of(place).open_journal(place, Which())) as journal:  # converts nothing
        assert [event for _, event in journal.take(offset=OFFSET)] == [submitted(1)]
    with opened(place) as store:
        assert [task.id for task in loaded(store).tasks] == [1]
    with tables(place) as file:
        file.execute(older)
    with pytest.raises(StoreError, match=r"by an old version .*: open it once with a version"):
        opened(place).__enter__()


def test_every_event_comes_back_as_it_was(place: str) -> None:
    """Each value of each kind: enums are enums, floats are floats, times are times."""
    found: list[Any] = []

    @settings(max_examples=15, derandomize=True, suppress_health_check=list(HealthCheck))
    @given(
        st.tuples(*map(st.from_type, JOURNALLED)),
        st.tuples(*map(st.from_type, get_args(Goal))),
    )
    def collect(events: tuple[Any, ...], goals: tuple[Goal, ...]) -> None:
        for event in (*events, *goals):
            first = submitted(len(found) + 1)
            if not hasattr(event, "at"):
                event = replace(first, task=replace(first.task, goal=event))
            elif isinstance(event, TaskSubmitted):
                event = replace(event, task=replace(event.task, id=first.task.id))
            elif hasattr(event, "task_id"):
                event = replace(event, task_id=first.task.id)
            found.append(event)

    collect()
    assert {type(event) for event in found} == set(JOURNALLED)
    with opened(place) as store:
        keep(store, *found)
        assert repr([event for _, event in store.journal()]) == repr(found)


def test_what_comes_back_is_what_became_of_each_task(place: str) -> None:
    firsts = [submitted(number, at=8.0) for number in range(1, 5)]
    starting, began = changed(firsts[0].task, S.STARTING, at=9.0)
    withdrawn = TaskWithdrawn(TaskId(4), 1, 9.0)
    events: list[Event] = [*firsts, began, withdrawn]
    with opened(place) as store:
        keep(store, *events)
    done = Progress(anchor=Pose(1.0, 2.0, 0.5), done=0.25, execution_time=3.0)
    driven, drove = changed(starting, S.EXECUTING, at=10.0, progress=done)
    leg = replace(done, leg=1)
    advanced = TaskAdvanced(TaskId(1), 1, driven.version + 1, leg, 10.5)
    paused, pause = changed(
        replace(driven, version=advanced.version, progress=leg), S.PAUSED, at=11
    )
    over, end = changed(firsts[1].task, S.CANCELLED, at=12.0)
    terms = Terms(priority=9, start_at=50.0, after=0)
    modified = TaskModified(TaskId(3), 1, 2, terms, "client", 2.0)
    then: list[Event] = [drove, advanced, pause, end, modified]
    with opened(place) as store:
        keep(store, *then)
        found = loaded(store)
        assert found.tasks == (paused, over, replace(firsts[2].task, terms=terms, version=2))
        assert list(store.journal()) == list(enumerate(events + then, 1))
        assert found.next_id == 5


def test_how_far_a_driven_task_has_come_is_kept_and_fills_no_journal(place: str) -> None:
    first = submitted(1, at=1.0)
    starting, began = changed(first.task, S.STARTING, at=2.0)
    driven, drove = changed(starting, S.EXECUTING, at=2.0)
    far = [
        TaskProgressed(TaskId(1), 1, driven.version, Progress(Pose(0.0, 0.0, 0.0), done=d), 3.0 + d)
        for d in (0.5, 1.0, 1.5)
    ]
    with opened(place) as store:
        keep(store, first, began, drove, *far)
    with opened(place) as store:
        restored = loaded(store)
        (kept,) = restored.tasks
        assert (kept.state, kept.version, kept.progress.done) == (S.EXECUTING, 3, 1.5)
        assert [event for _, event in store.journal()] == [first, began, drove]


def test_ids_begin_again_after_the_last_and_are_never_used_twice(place: str) -> None:
    with opened(place) as store:
        keep(store, *cancelled(1, at=1.0))
    with opened(place) as store:
        keep(store, submitted(MAX_TASK_ID, at=3.0), submitted(1, at=4.0))
        found = loaded(store)
        assert ([task.id for task in found.tasks], found.next_id) == ([MAX_TASK_ID, 1], 2)
        store.append([*cancelled(2, at=1.0), submitted(3), TaskWithdrawn(TaskId(3), 1, 5.0)])
    with opened(place, retention=Retention(max_age=None, max_count=0)) as store:
        found = loaded(store)
        assert ([task.id for task in found.tasks], found.next_id) == ([MAX_TASK_ID, 1], 4)


def test_what_is_known_of_vehicles_comes_back(place: str) -> None:
    events: list[Event] = [
        QueuePaused(1, R.STOPPED, "client", 1.0),
        QueuePaused(2, R.OPERATOR, "client", 1.0),
        QueueContinued(2, "client", 2.0),
        VehicleIdentified(1, "uid-1", 2.0),
        VehicleSpeedSet(1, 0.75, "client", 2.0),
        VehicleSpeedSet(2, 0.5, "client", 2.0),
        VehicleSpeedSet(2, None, "client", 3.0),
        PlanStored(1, 0, 17, "items", "client", 3.0),
        PlanStored(2, 1, 5, "fence", "client", 3.0),
        PlanStored(2, 1, 0, "", "client", 4.0),
        ParameterSet("TSK_SPEED", 0.7, "client", 4.0),
        ParameterSet("TSK_SPEED", 0.8, "client", 5.0),
        ParameterSet("TSK_QUOTA", 20.0, "client", 5.0),
        ParameterSet("TSK_QUOTA", None, "client", 6.0),
        SignaturesSeen((FIRST, SECOND), (), 9, 6.0),
        ServerStopped((1, 2), 7.0),
    ]
    with opened(place) as store:
        for event in events:
            store.append([event])
    with opened(place) as store:
        found = loaded(store)
        assert (found.paused, found.uids, found.speeds) == ({1: R.STOPPED}, {1: "uid-1"}, {1: 0.75})
        assert found.plans == {(1, 0): (17, "items")}
        assert found.parameters == {"TSK_SPEED": 0.8}
        assert list(store.journal())[-1] == (len(events), events[-1])
        store.append([SignaturesSeen((), (replace(FIRST, timestamp=0),), 9, 8.0)])
    with opened(place) as store:
        assert loaded(store).signatures == (SECOND,)


def test_times_are_those_of_the_process_that_loads(place: str) -> None:
    with opened(place, offset=OFFSET) as store:
        store.append([submitted(1, at=100.0)])
    with opened(place, offset=OFFSET + 90) as store:
        restored = loaded(store)
        (task,) = restored.tasks
        assert (task.submitted_at, task.terms.deadline) == (10.0, 70.0)


def test_closing_writes_what_is_left_and_notes_the_end(place: str) -> None:
    with opened(place) as store:
        store.append([submitted(n) for n in range(1, 3000)])
        store.close()
        assert store.take_outcomes()[-1] == Committed(2999)
        store.close()
        with pytest.raises(ValueError, match="closed"):
            store.append([])
    with opened(place) as store:
        found = loaded(store)
        assert (len(found.tasks), found.ended_well) == (2999, True)
        assert 0.0 <= found.idle < 10.0


def test_retention_takes_the_oldest_that_are_over_and_their_events(place: str) -> None:
    now = time.monotonic()
    events: list[Event] = [submitted(number, at=now - 10_000) for number in range(1, 601)]
    for number in range(1, 501):
        task = submitted(number, at=now - 10_000).task
        events.append(changed(task, S.CANCELLED, at=now - 6000 + 10 * number)[1])
    events += [VehicleSeen(1, "old", now - 7000)] * 2_001 + [VehicleSeen(1, "new", now - 5)]
    with opened(place) as store:
        store.append(events)
    for retention, first in (
        (Retention(max_age=4005.0, max_count=None), 200),
        (Retention(max_age=None, max_count=10), 491),
    ):
        with opened(place, retention=retention) as store:
            found = loaded(store)
            assert [task.id for task in found.tasks] == list(range(first, 601))
            left = [event for _, event in store.journal()]
            assert [e.text for e in left if isinstance(e, VehicleSeen)] == ["new"]
            about = {getattr(event, "task_id", 0) for event in left}
            assert about - {0} == set(range(first, 501))


def test_events_of_no_task_are_bounded_and_refusals_push_out_no_halts(place: str) -> None:
    bound = 20_000  # of one kind
    halts: list[Event] = [QueuePaused(1, R.STOPPED, "client", 1.0)] * 300
    refusal = SubmissionRefused(1, TASK_MOVE, R.STOPPED, "", "client", 2.0)
    with opened(place) as store:
        keep(store, *halts, *[refusal] * (bound + 5_000))
    with opened(place) as store, tables(place) as connection:
        end = time.monotonic() + 20.0
        count = "SELECT count(*) FROM journal"
        while connection.execute(count).fetchone()[0] > bound + 300 and time.monotonic() < end:
            time.sleep(0.05)
        left = [event for _, event in store.journal()]
    assert left == [*halts, *[refusal] * bound]


def test_a_locked_store_holds_nothing_up_and_nothing_is_lost(place: str) -> None:
    with opened(place) as store, locked(place) as other:
        longest = 0.0
        for number in range(1, 101):
            began = time.perf_counter()
            store.append([submitted(number)])
            longest = max(longest, time.perf_counter() - began)
        failure = wait_for_failure(store)
        assert place in failure.text
        assert "locked" in failure.text
        assert longest < 0.1
        other.execute("ROLLBACK")
        assert wait_for(store, 100)[-1] == Committed(100)
        assert [event for _, event in store.journal()] == [submitted(n) for n in range(1, 101)]


def test_a_stuck_disk_is_given_up_in_the_end(place: str) -> None:
    with opened(place) as store, locked(place) as other:
        store.append([submitted(1)])
        began = time.monotonic()
        store.close()
        assert time.monotonic() - began < 6.0
        told = store.take_outcomes()[-1]
        assert "1 events or more" in told.text  # type: ignore[union-attr]
        assert "lost" in told.text  # type: ignore[union-attr]
        other.execute("ROLLBACK")
    with opened(place) as store:
        found = loaded(store)
        assert (found.tasks, found.ended_well) == ((), False)


def test_a_task_of_a_version_with_fewer_fields_is_read(tmp_path: Path) -> None:
    place = str(tmp_path / "tasks.sqlite3")
    with opened(place) as store:
        keep(store, submitted(1))
    with tables(place) as older:
        older.execute("UPDATE formats SET names = json_remove(names, '$.TaskSubmitted[#-2]')")
        older.execute("UPDATE tasks SET submitted = json_remove(submitted, '$[#-2]')")
    with opened(place) as store:
        assert loaded(store).tasks == (submitted(1).task,)


def test_a_store_in_postgresql_says_which_package_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith("mav_tasks.store.postgres")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "psycopg", None)  # an import of it fails
    with pytest.raises(StoreError, match=r"^store postgresql://anna@host/x: needs the package psy"):
        open_store("postgresql://anna:secret@host/x")


def test_a_store_in_memory_keeps_the_order_and_no_state_over_runs() -> None:
    with closing(open_store(":memory:")) as store:
        assert store.load() is None
        events = cancelled(1, at=1.0)
        assert keep(store, *events)[-1] == Committed(2)
        assert list(store.journal()) == list(enumerate(events, 1))
        store.append(events * 100_000)
        assert [number for number, _ in store.journal()] == list(range(100_003, 200_003))
    with pytest.raises(StoreError, match="no journal"):
        kind_of(":memory:").open_journal(":memory:", Which())
