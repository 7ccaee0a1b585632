"""The table of transitions, and the picture in the design that it must cover."""

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
