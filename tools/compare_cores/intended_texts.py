"""Intended differences: what is said to clients, in texts and in statuses."""

import re
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

from .differences import Difference, Kind
from .entries import After, Condition, Intended, grew, only_one
from .wire import Sent

STATUS = "TASK_QUEUE_STATUS"


def _counts_halts(difference: Difference) -> bool:
    """The version of a queue counts all events of the store, halts of all rovers, too."""
    fields, new = difference.fields, difference.new
    if difference.name != STATUS or new is None or set(fields) != {"version", "halt_epoch"}:
        return False
    before = (
        sent.fields["version"]
        for _, sent in difference.moment.story.new(STATUS)
        if (sent.way, sent.source) == (new.way, new.source)
    )
    older, version = fields["version"]
    return bool(older < version <= 2 * older + 10 and version >= next(before, 0))


class Reworded(NamedTuple):
    """What was said before, and what is said instead: patterns; groups stand for the same."""

    old: str
    new: str

    def is_it(self, old: str, new: str) -> bool:
        """Whether these two texts are it."""
        before = re.fullmatch(self.old, old)
        after = re.fullmatch(self.new, new)
        if before is None or after is None:
            return False
        named, now_named = before.groupdict(), after.groupdict()
        return all(named[name] == now_named[name] for name in named.keys() & now_named.keys())


ROLE = r"role (?P<role>\w+) may not .*, (?P<least>\w+) may"
REWORDED = (
    Reworded(ROLE, ROLE),
    Reworded(
        r"Task (?P<id>\d+) waits: wrong mode, set HOLD",
        r"Task (?P<id>\d+) waits: wrong mode; set HOLD, then continue",
    ),
    Reworded(r"STOP is latched: continue first", r".* came since: if you still mean it, .*"),
    Reworded(r"cannot go on: wrong mode, set HOLD", r"cannot go on: wrong mode; set HOLD.*"),
)
#: what is an operator's no more: restarts, tests of motors, calibration
OF_SAFETY = Reworded(
    r"role (?P<role>\w+) may not .*, operator may", r"role (?P<role>\w+) may not .*, safety may"
)


def texts(packets: Sequence[Sent], way: tuple[str, str]) -> list[str]:
    """Give the texts that go one way, each put together of its pieces."""
    found: list[tuple[int, str]] = []
    for sent in (each for each in packets if each.name == "STATUSTEXT" and each.way == way):
        number, text = sent.fields.get("id", 0), sent.fields["text"].decode("utf-8", "replace")
        if number and found and found[-1][0] == number:
            found[-1] = number, found[-1][1] + text
        else:
            found.append((number, text))
    return [text for _, text in found]


def reworded(*patterns: Reworded) -> Condition:
    """Match a text that is told in other words; so must be all others of its instant."""

    def matches(difference: Difference) -> bool:
        sent = difference.new or difference.old
        if difference.name != "STATUSTEXT" or sent is None:
            return False
        old = Counter(texts(difference.moment.old, sent.way))
        new = Counter(texts(difference.moment.new, sent.way))
        gone, come = list((old - new).elements()), list((new - old).elements())
        return len(gone) == len(come) > 0 and all(
            any(each.is_it(one, other) for each in patterns)
            for one, other in zip(gone, come, strict=True)
        )

    return matches


def _is_renumbered(difference: Difference) -> bool:
    """The number of a text in pieces counts texts: one more or less was told before."""
    fields = difference.fields
    return difference.name == "STATUSTEXT" and set(fields) == {"id"} and all(fields["id"])


#: what is told when a plan or the return is started
OF_MODE = re.compile(rb"Task \d+ (begins now: return home|queued: plan of \d+ items?)")
ACK = "COMMAND_ACK"


def _counts_left_out(difference: Difference) -> bool:
    """How many texts were too many: those of a flood are others now."""
    sent = difference.new or difference.old
    return (
        difference.name == "STATUSTEXT"
        and sent is not None
        and re.fullmatch(rb"\d+ more messages: see the queue", sent.fields["text"]) is not None
    )


def _tells_of_mode(difference: Difference) -> bool:
    """SET_MODE is told of as DO_SET_MODE is."""
    new, now = difference.new, difference.now
    is_asked = any(True for _ in difference.moment.story.heard("SET_MODE", since=now))
    if difference.kind is not Kind.ADDED or new is None:
        return False
    if difference.name == "TASK_STATUS":  # to who asked, if it reads these
        return is_asked and new.fields["version"] == 1
    if difference.name != "STATUSTEXT":
        return False
    return is_asked and OF_MODE.fullmatch(new.fields["text"]) is not None


def _checked_first(difference: Difference) -> bool:
    """Of a go-to with a wrong speed and no place, the speed is told; it is refused all the same."""
    sent = difference.new or difference.old
    if difference.name != "STATUSTEXT" or sent is None:
        return False
    old = Counter(texts(difference.moment.old, sent.way))
    new = Counter(texts(difference.moment.new, sent.way))
    return (
        set(old - new) == {"latitude and longitude are 0: no place is given"}
        and all(re.fullmatch(r"param1 speed \S+ not in \S+", each) for each in new - old)
        and _answers(difference, is_new=False) == _answers(difference, is_new=True)
    )


def _among_texts(difference: Difference) -> bool:
    """Answers stand at another place among texts, and in the same order among themselves."""
    is_reordered = difference.kind is Kind.REORDERED and difference.name in (ACK, "STATUSTEXT")
    told = {each.name for each in (*difference.moment.old, *difference.moment.new)}
    same = _answers(difference, is_new=False) == _answers(difference, is_new=True)
    return is_reordered and "STATUSTEXT" in told and same


def _answers(difference: Difference, *, is_new: bool) -> list[tuple[Any, ...]]:
    packets = difference.moment.new if is_new else difference.moment.old
    return [(each.way, each.content) for each in packets if each.name == ACK]


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
    Intended(
        "texts in other words",
        "A refusal names the command by its name; a task that waits says all that is to be done.",
        reworded(*REWORDED),
    ),
    Intended(
        "what works on a rover is for the role safety",
        "Restarts, tests of motors and calibration bound a rover, or what holds it.",
        reworded(OF_SAFETY),
    ),
    Intended(
        "the number of a text in pieces",
        "It counts texts, and there were more or fewer before.",
        _is_renumbered,
    ),
    Intended(
        "SET_MODE is told of as DO_SET_MODE is",
        "Both are one request; everybody is told that the return begins.",
        _tells_of_mode,
    ),
    Intended(
        "of two faults of a go-to another one is told",
        "All parameters are read before the place is looked at.",
        _checked_first,
    ),
    Intended(
        "answers among texts",
        "Texts came or went; the answers are the same.",
        _among_texts,
    ),
    Intended(
        "how many texts were left out",
        "Of a flood of refusals others are told than before.",
        _counts_left_out,
    ),
    Intended(
        "MISSION_CURRENT at another time",
        "It is sent once a second and with each change, counted from the last.",
        lambda difference: only_one(difference) and difference.name == "MISSION_CURRENT",
        After.MOVED,
        within=1.2,
    ),
)
