"""The table of transitions, and the picture in the design that it must cover."""

from itertools import product

import pytest

from mav_tasks.errors import IllegalTransition
from mav_tasks.tasks.lifecycle import (
    ACTIVE,
    INITIAL,
    TERMINAL,
    TRANSITIONS,
    WAITING,
    TaskReason,
    TaskState,
    check_transition,
)

S = TaskState
EDGES = {(old, new) for old, ways in TRANSITIONS.items() for new in ways}
PAIRS = list(product(TaskState, TaskState))

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


def test_the_table_is_the_picture() -> None:
    assert {old: set(ways) for old, ways in TRANSITIONS.items()} == PICTURE


@pytest.mark.parametrize(("old", "new"), [p for p in PAIRS if p in EDGES])
def test_an_edge_of_the_table_is_allowed(old: TaskState, new: TaskState) -> None:
    check_transition(old, new)


@pytest.mark.parametrize(("old", "new"), [p for p in PAIRS if p not in EDGES])
def test_every_other_move_raises_and_says_which(old: TaskState, new: TaskState) -> None:
    with pytest.raises(IllegalTransition, match=f"^no transition {old.name} -> {new.name}$"):
        check_transition(old, new)


@pytest.mark.parametrize("state", sorted(TERMINAL))
def test_what_is_over_is_over_for_good(state: TaskState) -> None:
    assert state not in TRANSITIONS


def test_every_edge_says_who_moves_the_task_and_why() -> None:
    assert all(why for ways in TRANSITIONS.values() for why in ways.values())


def test_states_are_waiting_active_or_over() -> None:
    assert WAITING | ACTIVE | TERMINAL | {S.UNKNOWN} == set(TaskState)
    assert len(WAITING) + len(ACTIVE) + len(TERMINAL) + 1 == len(TaskState)
    assert INITIAL == WAITING


def test_every_state_can_be_reached_and_left_towards_an_end() -> None:
    reached, border = set(INITIAL), list(INITIAL)
    while border:
        for new in TRANSITIONS.get(border.pop(), {}):
            if new not in reached:
                reached.add(new)
                border.append(new)
    assert reached == set(TaskState) - {S.UNKNOWN}
    assert all(S.KILLED in ways for ways in TRANSITIONS.values())


REASONS = {
    0: "NONE",
    1: """START_TIME DEPENDENCY BEHIND_OTHERS QUEUE_PAUSED WAITING_FOR_START DISARMED WRONG_MODE
          NO_POSITION VEHICLE_SILENT OTHER_CONTROLLER HELD_AHEAD RESTARTED NOT_READY
          LOSS_FAILSAFE OUTSIDE_OWN_FENCE""",
    30: "OPERATOR PREEMPTED TAKEOVER LINK_LOST POSITION_LOST STOPPED FAILSAFE LEASE_LOST",
    50: "OUTCOME_UNKNOWN FENCE LATE OFF_TRACK FRAME_RESET STOP_UNCONFIRMED OVERSPEED",
    70: """STUCK ARM_REFUSED MODE_REFUSED START_TIMEOUT LINK_TIMEOUT DEPENDENCY_FAILED DEADLINE
           CANCELLED CLEARED REPLACED STOP SKIPPED""",
    100: """QUEUE_FULL QUOTA STORE_UNAVAILABLE BAD_PARAMETER BAD_FRAME OUTSIDE_FENCE
            NOT_SUPPORTED_BY_VEHICLE NOT_FOUND NOT_ALLOWED UNKNOWN_DEPENDENCY CYCLE NONCE_REUSED
            WRONG_STATE RATE_LIMITED STALE""",
}


def test_reasons_are_numbered_in_order_from_the_base_of_their_kind() -> None:
    assert {reason.name: reason.value for reason in TaskReason} == {
        name: base + number
        for base, names in REASONS.items()
        for number, name in enumerate(names.split())
    }
