"""Intended differences: words of clients that the new core refuses, or answers otherwise."""

from .differences import Difference
from .entries import After, Intended
from .words import (
    ACCEPTED,
    ACK,
    DENIED,
    NOT_ALLOWED,
    RATE_LIMITED,
    STALE,
    TEMPORARILY_REJECTED,
    VEHICLE_SILENT,
    Answered,
    is_about,
    rejected_as,
    result_of,
    why_older,
)

#: of which the policy table says "not beside a task", and the former lists did not
NOT_BESIDE_A_TASK = frozenset({310, *range(31000, 31015)})


def _did_something(each: Answered) -> bool:
    """Whether the old core obeyed a word, or passed it on to the rover."""
    return each.old is None or result_of(each.old) == (ACCEPTED, each.old.fields["result_param2"])


def _older(difference: Difference) -> list[Answered]:
    found = rejected_as(difference, TEMPORARILY_REJECTED, STALE)
    return [each for each in found if why_older(each.word, difference.moment.story)]


def _older_than_halt(difference: Difference) -> bool:
    return any(_did_something(each) for each in _older(difference))


def _older_than_halt_and_refused_before(difference: Difference) -> bool:
    return any(is_about(difference, each) for each in _older(difference))


def _beside_a_task(difference: Difference) -> bool:
    found = rejected_as(difference, DENIED, NOT_ALLOWED)
    return any(
        each.command in NOT_BESIDE_A_TASK and is_about(difference, each)
        for each in found
        if any(b"not while tasks drive" in s.fields.get("text", b"") for s in difference.moment.new)
    )


def _busy(difference: Difference) -> bool:
    """An unsent command: its asker is told that the rover is busy, not that it is silent."""
    fields = difference.fields
    if difference.name == ACK:
        return fields == {"result_param2": (VEHICLE_SILENT, RATE_LIMITED)}
    if difference.name != "STATUSTEXT" or set(fields) - {"severity", "text", "id"}:
        return False
    old, new = fields.get("text", (b"", b""))
    return bytes(old).partition(b": no answer")[0] == bytes(new).partition(b": rover")[0] and bytes(
        new
    ).endswith(b"is busy, ask again")


TABLE = (
    Intended(
        "a word older than a halt is refused, STALE",
        "What holds beats every older word that lets go; the rover goes on standing.",
        _older_than_halt,
        After.DIVERGES,
    ),
    Intended(
        "what was refused before is refused as STALE",
        "That it is older than a halt is looked at first.",
        _older_than_halt_and_refused_before,
    ),
    Intended(
        "no command of its own meaning beside a task",
        "What is not known to be harmless does not reach a rover that a task drives.",
        _beside_a_task,
    ),
    Intended(
        "a command that never left is answered: busy",
        "The rover was not asked, so it cannot be said to be silent.",
        _busy,
    ),
)
