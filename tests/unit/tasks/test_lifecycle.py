"""The table of transitions, and the picture in the design that it must cover."""

import pytest

from mav_tasks.errors import IllegalTransition
from mav_tasks.tasks.lifecycle import (
    ACTIVE,
    INITIAL,
    TERMINAL,
    TRANSITIONS,
    WAITING,
    TaskState,
    check_transition,
)

S = TaskState
#: the picture: what may follow what
PICTURE = {
    S.SCHEDULED: {S.BLOCKED, S.QUEUED, S.CANCELLED, S.EXPIRED, S.FAILED, S.KILLED},
    S.BLOCKED: {S.SCHEDULED, S.QUEUED, S.CANCELLED, S.EXPIRED, S.FAILED, S.KILLED},
    S.QUEUED: {S.SCHEDULED, S.BLOCKED, S.STARTING, S.CANCELLED, S.EXPIRED, S.FAILED, S.KILLED},
    S.STARTING: {S.EXECUTING, S.PAUSED, S.CANCELLING, S.FAILED, S.HELD, S.KILLED},
    S.EXECUTING: {S.COMPLETED, S.PAUSED, S.CANCELLING, S.FAILED, S.HELD, S.KILLED},
    S.PAUSED: {S.STARTING, S.CANCELLING, S.FAILED, S.HELD, S.KILLED},
    S.CANCELLING: {S.CANCELLED, S.HELD, S.KILLED},
    S.HELD: {S.STARTING, S.CANCELLED, S.KILLED},
}


def test_the_table_is_the_picture_and_nothing_else_is_allowed() -> None:
    assert {old: set(ways) for old, ways in TRANSITIONS.items()} == PICTURE
    assert all(why for ways in TRANSITIONS.values() for why in ways.values())
    for old in TaskState:
        for new in TaskState:
            if new in PICTURE.get(old, ()):
                check_transition(old, new)
                continue
            with pytest.raises(
                IllegalTransition, match=f"^no transition {old.name} -> {new.name}$"
            ):
                check_transition(old, new)


def test_states_are_waiting_active_or_over() -> None:
    kinds = (WAITING, ACTIVE, TERMINAL, {S.UNKNOWN})
    assert sorted(state for kind in kinds for state in kind) == sorted(TaskState)
    assert INITIAL == WAITING
    assert set(PICTURE) == WAITING | ACTIVE, "what is over is over for good"
    assert all(S.KILLED in ways for ways in PICTURE.values())
