"""What came otherwise at one instant: packets changed, missing, added, or in another order.

Packets to one peer are compared in their order, whatever goes to others in between. Sequence
numbers count only as long as both cores have sent as many packets before.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from difflib import SequenceMatcher
from enum import Enum
from typing import Any

from .story import Moment, Story
from .wire import Sent

ABSENT = "(no such field)"
SET_MESSAGE_INTERVAL = 511


class Kind(Enum):
    """How a packet differs."""

    CHANGED = "changed"
    MISSING = "missing"  # only the old core sends it
    ADDED = "added"  # only the new one does
    RENUMBERED = "renumbered"  # nothing but its sequence number, CRC or signature
    REORDERED = "reordered"  # the same packets, those to several peers in another order
    CRASHED = "crashed"  # the new core raised


@dataclass(frozen=True, slots=True)
class Difference:
    """One packet that differs, at ``now`` of the run."""

    kind: Kind
    now: float
    old: Sent | None
    new: Sent | None
    text: str = ""
    #: all that was sent at this instant, and what led to it
    moment: Moment = field(default_factory=Moment, compare=False, repr=False)

    @property
    def name(self) -> str:
        """Give the name of its message."""
        sent = self.new or self.old
        return "" if sent is None else sent.name

    @property
    def fields(self) -> dict[str, tuple[Any, Any]]:
        """Give the fields that differ, old and new; ABSENT where a revision has no such field."""
        if self.old is None or self.new is None:
            return {}
        old, new = self.old.fields, self.new.fields
        names = dict.fromkeys([*old, *new])
        pairs = {name: (old.get(name, ABSENT), new.get(name, ABSENT)) for name in names}
        return {name: (a, b) for name, (a, b) in pairs.items() if repr(a) != repr(b)}

    def lines(self) -> Iterator[str]:
        """Say it in words."""
        yield f"{self.kind.value} {self.name} at {self.now:.6f} s {self.text}".rstrip()
        for name, (old, new) in self.fields.items():
            yield f"    {name}: {old!r} → {new!r}"
        for what, sent in (("old", self.old), ("new", self.new)):
            if sent is not None:
                yield f"  {what}: {sent}"


def differences(
    old: Sequence[Sent],
    new: Sequence[Sent],
    *,
    now: float,
    counts_numbers: bool,
    story: Story | None = None,
) -> list[Difference]:
    """Give how the packets of one instant differ; ``counts_numbers``: sequence numbers do, too."""
    if [(s.way, s.data, s.is_first) for s in old] == [(s.way, s.data, s.is_first) for s in new]:
        return []
    found: list[Difference] = []
    for way in dict.fromkeys(s.way for s in (*old, *new)):
        ours = [s for s in old if s.way == way]
        theirs = [s for s in new if s.way == way]
        found += _in_place(
            list(_of_way(ours, theirs, now=now, counts_numbers=counts_numbers)), now=now
        )
    if not found and [(s.way, s.content) for s in old] != [(s.way, s.content) for s in new]:
        orders = " / ".join(", ".join(s.name for s in each) for each in (old, new))
        found.append(Difference(Kind.REORDERED, now, old[0], new[0], orders))
    moment = Moment(old, new) if story is None else Moment(old, new, story)
    return [replace(each, moment=moment) for each in found]


def _in_place(found: list[Difference], *, now: float) -> list[Difference]:
    """Make of what is missing at one place and added at another of an instant: reordered."""
    missing = [each for each in found if each.kind is Kind.MISSING]
    kept = [each for each in found if each.kind is not Kind.MISSING]
    for one in missing:
        assert one.old is not None
        other = next(
            (
                each
                for each in kept
                if each.kind is Kind.ADDED and each.new and each.new.content == one.old.content
            ),
            None,
        )
        if other is None:
            kept.append(one)
        else:
            kept[kept.index(other)] = Difference(Kind.REORDERED, now, one.old, other.new)
    return kept


def _of_way(
    old: Sequence[Sent], new: Sequence[Sent], *, now: float, counts_numbers: bool
) -> Iterator[Difference]:
    matcher = SequenceMatcher(None, [s.content for s in old], [s.content for s in new], False)
    for what, a, b, c, d in matcher.get_opcodes():
        if what == "equal":
            for one, other in zip(old[a:b], new[c:d], strict=True):
                if counts_numbers and one.data != other.data:
                    yield Difference(Kind.RENUMBERED, now, one, other)
        else:
            yield from _replaced(old[a:b], new[c:d], now=now)


def _subject(sent: Sent) -> tuple[Any, ...]:
    """Give what a packet is about: two that differ here are no change of each other."""
    subject: tuple[Any, ...] = sent.message_id, sent.source
    if sent.name in ("COMMAND_LONG", "COMMAND_INT"):
        subject += (sent.fields["command"], sent.fields["param1"])
        if sent.fields["command"] == SET_MESSAGE_INTERVAL:
            subject += (sent.fields["param2"],)
    elif sent.name in ("COMMAND_ACK", "TASK_STATUS"):
        subject += (sent.fields.get("command"), sent.fields.get("task_id"))
    return subject


def _replaced(old: Sequence[Sent], new: Sequence[Sent], *, now: float) -> Iterator[Difference]:
    """Pair packets of one kind and source; what is left over is missing or added."""
    left = list(new)
    for one in old:
        same = (s for s in left if _subject(s) == _subject(one))
        other = next(same, None)
        if other is None:
            yield Difference(Kind.MISSING, now, one, None)
        else:
            left.remove(other)
            yield Difference(Kind.CHANGED, now, one, other)
    for other in left:
        yield Difference(Kind.ADDED, now, None, other)
