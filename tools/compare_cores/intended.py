"""The table of intended differences: what the new core is meant to send otherwise, and why.

Each difference of a packet is held against the entries in order; the first that matches explains
it. After one that DIVERGES the two runs are no longer the same run (a refused *continue* leaves
the rover standing): nothing later in that record is compared. What no entry explains is a mistake,
or belongs here.

Whoever changes what is sent adds an entry in the same commit. Keep it narrow: message, fields and
values; an entry that matches too much hides the next mistake.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from enum import Enum, auto

from .differences import ABSENT, Difference, Kind

ACK = "COMMAND_ACK"
ACCEPTED = 0


class After(Enum):
    """What becomes of the record after a difference."""

    COMPARED = auto()
    DIVERGES = auto()


@dataclass(frozen=True, slots=True)
class Intended:
    """One entry."""

    name: str
    why: str
    matches: Callable[[Difference], bool]
    after: After = After.COMPARED


# what entries are made of


def grew(message: str, field: str) -> Callable[[Difference], bool]:
    """Match a message that differs by one field only, which the old revision did not have."""

    def matches(difference: Difference) -> bool:
        found = difference.fields
        return (
            difference.kind is Kind.CHANGED
            and difference.name == message
            and set(found) == {field}
            and found[field][0] == ABSENT
        )

    return matches


def refused(commands: Collection[int], results: Collection[int]) -> Callable[[Difference], bool]:
    """Match an answer to these commands: the old core accepted, the new one says otherwise."""

    def matches(difference: Difference) -> bool:
        old, new = difference.old, difference.new
        return (
            difference.kind is Kind.CHANGED
            and difference.name == ACK
            and old is not None
            and new is not None
            and old.fields["command"] == new.fields["command"]
            and new.fields["command"] in commands
            and old.fields["result"] == ACCEPTED
            and new.fields["result"] in results
        )

    return matches


def says(kind: Kind, message: str, part: str = "") -> Callable[[Difference], bool]:
    """Match a message that is missing, added or changed; ``part`` stands in its text."""

    def matches(difference: Difference) -> bool:
        sent = difference.new or difference.old
        if difference.kind is not kind or difference.name != message or sent is None:
            return False
        text = sent.fields.get("text", b"")
        return part.encode() in text if isinstance(text, bytes) else not part

    return matches


INTENDED: tuple[Intended, ...] = (
    Intended(
        "TASK_QUEUE_STATUS grew by halt_epoch",
        "Clients send back with a go command which halt they have seen.",
        grew("TASK_QUEUE_STATUS", "halt_epoch"),
    ),
    Intended(
        "TASK_STATUS grew by halt_epoch",
        "The same, for whoever looks at one task only.",
        grew("TASK_STATUS", "halt_epoch"),
    ),
)
