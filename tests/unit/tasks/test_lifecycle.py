"""The table of transitions, and the picture in the design that it must cover."""

import pytest

from mav_tasks.basics.errors import IllegalTransition
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
    TaskState[old]: {TaskState[new] for new in ways.split()}
    for old, _, ways in (
        row.partition(": ")
        for row in """SCHEDULED: BLOCKED QUEUED CANCELLED EXPIRED FAILED KILLED
BLOCKED: SCHEDULED QUEUED CANCELLED EXPIRED FAILED KILLED
QUEUED: SCHEDULED BLOCKED STARTING CANCELLED EXPIRED FAILED KILLED
STARTING: EXECUTING PAUSED CANCELLING FAILED HELD KILLED
EXECUTING: COMPLETED PAUSED CANCELLING FAILED HELD KILLED
PAUSED: STARTING CANCELLING FAILED HELD KILLED
CANCELLING: CANCELLED HELD KILLED
HELD: STARTING CANCELLED KILLED""".splitlines()
    )
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
