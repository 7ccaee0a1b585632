"""What every durable store does, on each kind of database."""

import time

import pytest

from mav_tasks.settings import Retention
from mav_tasks.store import Kept, NotKept
from mav_tasks.store.batch import Batch
from mav_tasks.tasks.events import (
    Event,
    PlanStored,
    QueueContinued,
    QueuePaused,
    ServerStopped,
    TaskModified,
    VehicleIdentified,
    VehicleSeen,
    VehicleSpeedSet,
)
from mav_tasks.tasks.goal import Move
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.server_events import ParameterSet
from mav_tasks.tasks.task import MAX_TASK_ID, Pose, Progress, TaskId, Terms
from tests.kit.databases import disk_error, locked, tables
from tests.unit.store.samples import (
    OFFSET,
    finish,
    opened,
    submitted,
    wait_for,
    wait_for_failure,
)
from tests.unit.tasks.samples import draft

R, S = TaskReason, TaskState


def test_a_new_store_holds_nothing(place: str) -> None:
    with opened(place) as store:
        assert store.load() == Restored(wall_offset=OFFSET)
        assert store.take_outcomes() == []


def test_events_are_kept_and_the_descriptor_says_so(place: str) -> None:
    with opened(place) as store:
        store.append([submitted(1), submitted(2)])
        store.append([VehicleSeen(1, "found", 1.0)])
        assert wait_for(store, 3)[-1] == Kept(3)
        assert store.take_outcomes() == []


def test_what_comes_back_is_what_the_book_has(place: str) -> None:
    registry = TaskRegistry()
    for _ in range(4):
        registry.submit(draft(Move(2.5), priority=3), now=8.0)
    registry.change(TaskId(1), S.STARTING, reason=R.NONE, actor="server", now=9.0)
    registry.withdraw(TaskId(4), now=9.0)
    events = registry.take_events()
    with opened(place) as store:
        store.append(events)
        wait_for(store, len(events))
    progress = Progress(anchor=Pose(1.0, 2.0, 0.5), done=0.25, execution_time=3.0)
    registry.change(
        TaskId(1), S.EXECUTING, reason=R.NONE, actor="server", now=10.0, progress=progress
    )
    registry.change(TaskId(1), S.PAUSED, reason=R.OPERATOR, actor="client", now=11.0)
    finish(registry, 2, now=12.0)
    later = registry.take_events()
    with opened(place) as store:
        store.append(later)
        wait_for(store, len(later))
        assert store.load().tasks == registry.all()
        assert [event for _, event in store.journal()] == events + later
        assert [number for number, _ in store.journal()] == list(range(1, 10))
        assert store.load().next_id == 5


def test_ids_that_begin_again_take_the_place_of_what_is_over(place: str) -> None:
    old, new = TaskRegistry(), TaskRegistry(next_id=MAX_TASK_ID)
    old.submit(draft(), now=1.0)
    finish(old, 1, now=2.0)
    for now in (3.0, 4.0):
        new.submit(draft(priority=9), now=now)
    before, after = old.take_events(), new.take_events()
    with opened(place) as store:
        store.append(before)
        wait_for(store, len(before))
    with opened(place) as store:
        store.append(after)
        wait_for(store, len(after))
        found = store.load()
        assert (found.tasks, found.next_id) == (new.all(), 2)
        assert [task.id for task in found.tasks] == [MAX_TASK_ID, 1]


def test_new_terms_and_a_new_state_both_count(place: str) -> None:
    registry = TaskRegistry()
    task = registry.submit(draft(), now=1.0)
    terms = Terms(priority=9, start_at=50.0, after=0)
    modified = TaskModified(task.id, 1, 2, terms, "client", 2.0)
    with opened(place) as store:
        store.append([*registry.take_events(), modified])
        wait_for(store, 2)
        (found,) = store.load().tasks
        assert (found.terms, found.version, found.state) == (terms, 2, S.QUEUED)


def test_the_leg_that_was_begun_last_is_kept_with_its_version(place: str) -> None:
    registry = TaskRegistry()
    task = registry.submit(draft(), now=1.0)
    for state in (S.STARTING, S.EXECUTING):
        registry.change(task.id, state, reason=R.NONE, actor="server", now=2.0)
    registry.advance(task.id, Progress(anchor=Pose(1.0, 2.0, 0.5), done=0.25, leg=1), now=3.0)
    events = registry.take_events()
    with opened(place) as store:
        store.append(events)
        wait_for(store, len(events))
        assert store.load().tasks == registry.all()
    registry.change(task.id, S.PAUSED, reason=R.OPERATOR, actor="client", now=4.0)
    with opened(place) as store:
        store.append(registry.take_events())
    with opened(place) as store:
        assert store.load().tasks == registry.all()


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
    ]
    with opened(place) as store:
        for event in events:
            store.append([event])
        wait_for(store, len(events))
        found = store.load()
        assert (found.paused, found.uids, found.speeds) == ({1: R.STOPPED}, {1: "uid-1"}, {1: 0.75})
        assert found.plans == {(1, 0): (17, "items")}
        assert found.parameters == {"TSK_SPEED": 0.8}


def test_times_are_those_of_the_process_that_loads(place: str) -> None:
    with opened(place, offset=OFFSET) as store:
        store.append([submitted(1, at=100.0)])
    with opened(place, offset=OFFSET + 90) as store:
        (task,) = store.load().tasks
        assert (task.submitted_at, task.terms.deadline) == (10.0, 70.0)


def test_closing_writes_what_is_left_and_notes_the_end(place: str) -> None:
    with opened(place) as store:
        store.append([submitted(n) for n in range(1, 3000)])
        store.close()
        assert store.take_outcomes()[-1] == Kept(2999)
        store.close()
        with pytest.raises(ValueError, match="closed"):
            store.append([])
    with opened(place) as store:
        found = store.load()
        assert (len(found.tasks), found.ended_well) == (2999, True)
        assert 0.0 <= found.idle < 10.0


def test_ids_are_never_used_again(place: str) -> None:
    registry = TaskRegistry()
    for _ in range(3):
        registry.submit(draft(), now=1.0)
    registry.withdraw(TaskId(3), now=1.0)
    finish(registry, 2, now=1.0)
    with opened(place) as store:
        store.append(registry.take_events())
    with opened(place, retention=Retention(max_age=None, max_count=0)) as store:
        found = store.load()
        assert ([task.id for task in found.tasks], found.next_id) == ([1], 4)


def test_retention_takes_the_oldest_that_are_over_and_their_events(place: str) -> None:
    registry = TaskRegistry()
    now = time.monotonic()
    for _ in range(600):
        registry.submit(draft(), now=now - 10_000)
    for number in range(1, 501):
        finish(registry, number, now=now - 6000 + 10 * number)
    events: list[Event] = [VehicleSeen(1, "old", now - 7000), VehicleSeen(1, "new", now - 5)]
    with opened(place) as store:
        store.append([*registry.take_events(), *events])
    with opened(place, retention=Retention(max_age=4005.0, max_count=None)) as store:
        assert [task.id for task in store.load().tasks] == list(range(200, 601))
        texts = [e.text for _, e in store.journal() if isinstance(e, VehicleSeen)]
        assert texts == ["new"]
    with opened(place, retention=Retention(max_age=None, max_count=10)) as store:
        assert [task.id for task in store.load().tasks] == list(range(491, 601))
        about = {getattr(event, "task_id", 0) for _, event in store.journal()}
        assert about - {0} == set(range(491, 501))


def test_the_trimmer_goes_on_beside_the_writer(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mav_tasks.store.durable.TRIM_AT_OPEN", 0.0)
    registry = TaskRegistry()
    for number in range(1, 601):
        registry.submit(draft(), now=1.0)
        finish(registry, number, now=1.0)
    with opened(place) as store:
        store.append(registry.take_events())
    with opened(place, retention=Retention(max_age=None, max_count=0)) as store:
        end = time.monotonic() + 10
        while store.load().tasks and time.monotonic() < end:
            store.append([VehicleSeen(1, "again", 1.0)])
            time.sleep(0.02)
        assert store.load().tasks == ()


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
        assert wait_for(store, 100)[-1] == Kept(100)
        assert [event for _, event in store.journal()] == [submitted(n) for n in range(1, 101)]


def test_a_stuck_disk_is_given_up_in_the_end(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mav_tasks.store.durable.CLOSE_LIMIT", 0.3)
    with opened(place) as store, locked(place) as other:
        store.append([submitted(1)])
        began = time.monotonic()
        store.close()
        assert time.monotonic() - began < 3.0
        assert "1 events or more are lost" in store.take_outcomes()[-1].text  # type: ignore[union-attr]
        other.execute("ROLLBACK")
    with opened(place) as store:
        assert (store.load().tasks, store.load().ended_well) == ((), False)


def test_a_commit_that_failed_and_yet_was_made_is_not_made_twice(
    place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    failures = [disk_error(place)]

    with opened(place) as store:
        write = store._database.write

        def fail_once(batch: Batch, *, utc: float) -> None:
            write(batch, utc=utc)
            if failures:
                raise failures.pop()

        monkeypatch.setattr(store._database, "write", fail_once)
        store.append([submitted(1), VehicleSeen(1, "found", 1.0)])
        outcomes = wait_for(store, 2)
        assert [type(outcome) for outcome in outcomes] == [NotKept, Kept]
        store.append([submitted(2)])
        wait_for(store, 3)
        assert [number for number, _ in store.journal()] == [1, 2, 3]


def test_our_own_mistake_is_raised_where_outcomes_are_taken(place: str) -> None:
    with opened(place) as store:
        store.append([VehicleSpeedSet(1, float("nan"), "client", 1.0)])
        with pytest.raises(ValueError, match="JSON"):
            wait_for(store, 1)


def test_the_last_word_of_a_server_is_kept(place: str) -> None:
    with opened(place) as store:
        store.append([ServerStopped((1, 2), 3.0)])
    with opened(place) as store:
        assert list(store.journal()) == [(1, ServerStopped((1, 2), 3.0))]


def test_how_far_a_driven_task_has_come_is_kept_and_fills_no_journal(place: str) -> None:
    registry = TaskRegistry()
    task = registry.submit(draft(goal=Move(4.0)), now=1.0)
    for state in (S.STARTING, S.EXECUTING):
        registry.change(task.id, state, reason=R.NONE, actor="server", now=2.0)
    for second in range(1, 4):
        registry.note_progress(task.id, Progress(Pose(0.0, 0.0, 0.0), done=0.5 * second))
        registry.keep_progress(task.id, now=2.0 + second)
    with opened(place) as store:
        store.append(registry.take_events())
        wait_for(store, 6)
    with opened(place) as store:
        (kept,) = store.load().tasks
        assert (kept.state, kept.version, kept.progress.done) == (S.EXECUTING, 3, 1.5)
    with tables(place) as connection:
        kinds = [row[0] for row in connection.execute("SELECT kind FROM journal")]
    assert kinds == ["TaskChanged", "TaskChanged"]
