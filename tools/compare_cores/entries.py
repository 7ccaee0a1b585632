"""What an entry of the table of intended differences is, and what its conditions are made of."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from enum import Enum, auto

from .differences import ABSENT, Difference, Kind

ACK = "COMMAND_ACK"
ACCEPTED = 0

Condition = Callable[[Difference], bool]


class After(Enum):
    """What becomes of the record after a difference."""

    COMPARED = auto()
    #: the same packet is sent at another time: within ``Intended.within`` s it must be found
    MOVED = auto()
    #: the runs are no longer the same run: packets are not compared, only that nothing is moved
    DIVERGES = auto()


@dataclass(frozen=True, slots=True)
class Intended:
    """One entry."""

    name: str
    why: str
    matches: Condition
    after: After = After.COMPARED
    within: float = 0.0  # s, of what is MOVED
    #: what is MOVED and must be found again: what only the old core has sent, only the new, or both
    owes: tuple[Kind, ...] = (Kind.MISSING, Kind.ADDED)
    #: s after a split in which the other core says the same texts; 0: it need not
    told_within: float = 0.0
    #: after a split the new core may move the rover: it has obeyed a word that the old one refused
    may_move: bool = False


def only_one(difference: Difference) -> bool:
    """Whether it is a packet that only one core sends."""
    return difference.kind in (Kind.MISSING, Kind.ADDED)


def grew(message: str, field: str) -> Condition:
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


def refused(commands: Collection[int], results: Collection[int]) -> Condition:
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


def says(kind: Kind, message: str, part: str = "") -> Condition:
    """Match a message that is missing, added or changed; ``part`` stands in its text."""

    def matches(difference: Difference) -> bool:
        sent = difference.new or difference.old
        if difference.kind is not kind or difference.name != message or sent is None:
            return False
        text = sent.fields.get("text", b"")
        return part.encode() in text if isinstance(text, bytes) else not part

    return matches
