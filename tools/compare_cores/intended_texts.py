"""Intended differences: what is said to clients, in texts and in statuses."""

from .differences import ABSENT, Difference, Kind
from .entries import Condition, Intended, grew

STATUS = "TASK_QUEUE_STATUS"


def _counts_halts(difference: Difference) -> bool:
    """The version of a queue counts all events of the store, halts too: it is never behind."""
    fields = difference.fields
    if difference.name != STATUS or set(fields) != {"version", "halt_epoch"}:
        return False
    old, new = fields["version"]
    behind = fields["halt_epoch"][1] - 1
    return bool(fields["halt_epoch"][0] == ABSENT and 0 < new - old <= max(behind, 0) * 2)


def reworded(old: bytes, new: bytes) -> Condition:
    """Match a text that begins with ``old`` and was told in other words, beginning with ``new``."""

    def matches(difference: Difference) -> bool:
        fields = difference.fields
        return (
            difference.kind is Kind.CHANGED
            and difference.name == "STATUSTEXT"
            and set(fields) == {"text"}
            and fields["text"][0].startswith(old)
            and fields["text"][1].startswith(new)
        )

    return matches


TABLE = (
    Intended(
        "TASK_QUEUE_STATUS grew by halt_epoch",
        "Clients send back with a go command which halt they have seen.",
        grew(STATUS, "halt_epoch"),
    ),
    Intended(
        "TASK_STATUS grew by halt_epoch",
        "The same, for whoever looks at one task only.",
        grew("TASK_STATUS", "halt_epoch"),
    ),
    Intended(
        "TASK_QUEUE_STATUS counts halts, too",
        "Each halt is an event of the store; a version only has to grow.",
        _counts_halts,
    ),
)
