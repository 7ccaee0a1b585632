"""What a modification changed is told in the log, as far as the journal's entry has it."""

from dataclasses import replace

import pytest

from mav_tasks.tasks.events import TaskModified
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import TaskId, Terms
from mav_tasks.tasks.term_changes import changes_of
from tests.unit.tasks.samples import draft

BEFORE = Terms(after=4, start_at=130.0, deadline=160.0, is_staged=True, label="scan")
AT = 100.0


@pytest.mark.parametrize(
    ("after", "words"),
    [
        (replace(BEFORE), ""),
        (replace(BEFORE, priority=9), "priority 9 (was 5)"),
        (replace(BEFORE, after=3), "runs after task 3"),
        (replace(BEFORE, after=0), "runs after no other task"),
        (replace(BEFORE, start_at=160.04), "start in 60 s"),
        (replace(BEFORE, start_at=None), "no start time"),
        (replace(BEFORE, start_at=None, start_utc=1_795_255_200), "start at 2026-11-21 10:00 UTC"),
        (replace(BEFORE, deadline=190.5), "deadline in 90.5 s"),
        (replace(BEFORE, deadline=None), "no deadline"),
        (replace(BEFORE, is_preemptible=False), "not pre-emptible"),
        (replace(BEFORE, is_preemptive=True), "pre-emptive"),
        (replace(BEFORE, is_staged=False), "start command received"),
        (replace(BEFORE, label="home"), "label 'home'"),
        (replace(BEFORE, label=""), "no label"),
        (replace(BEFORE, priority=1, label=""), "priority 1 (was 5), no label"),
    ],
)
def test_the_changed_terms_are_named_with_their_values(after: Terms, words: str) -> None:
    assert changes_of(BEFORE, after, at=AT) == words


def test_an_entry_says_what_changed_and_an_older_one_only_that_something_did() -> None:
    event = TaskModified(TaskId(3), 1, 2, replace(BEFORE, priority=9), "a", AT, BEFORE)
    assert str(event) == "rover 1: task 3 modified by a: priority 9 (was 5)"
    assert str(replace(event, terms=BEFORE)) == "rover 1: task 3 modified by a: no change"
    assert str(replace(event, before=None)) == "rover 1: task 3 modified by a"


def test_the_registry_keeps_the_terms_before() -> None:
    registry = TaskRegistry()
    task = registry.submit(draft(), now=1.0)
    registry.modify(task.id, replace(task.terms, priority=9), actor="a", now=2.0)
    event = registry.take_events()[-1]
    assert isinstance(event, TaskModified)
    assert event.before == task.terms
