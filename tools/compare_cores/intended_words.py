"""Intended differences: words of clients that the new core refuses, or answers otherwise."""

from collections import Counter
from collections.abc import Sequence

from mav_tasks.engine.policy import Kind as PolicyKind
from mav_tasks.engine.policy import row_of_message

from .differences import Difference, Kind
from .entries import After, Intended
from .rovers import OURS, REQUEST_MESSAGE
from .wire import Sent
from .words import (
    ACK,
    COMMANDS,
    DENIED,
    NOT_ALLOWED,
    RATE_LIMITED,
    RELEASE,
    STALE,
    TEMPORARILY_REJECTED,
    VEHICLE_SILENT,
    Refusals,
    is_about,
    is_halt,
    refusals,
    why_older,
)

ANSWERS = 3.0  # s in which a rover answers

#: of which the policy table says "not beside a task", and the former lists did not
NOT_BESIDE_A_TASK = frozenset({310, *range(31000, 31015)})


def _older(difference: Difference) -> list[Refusals]:
    """Give what is refused as STALE, and may be older than a halt by the contract's rules."""
    story = difference.moment.story
    found = refusals(difference, TEMPORARILY_REJECTED, STALE)
    return [each for each in found if any(why_older(word, story) for word in each.words)]


def _older_than_halt(difference: Difference) -> bool:
    return any(each.did_something for each in _older(difference))


def _older_than_halt_and_refused_before(difference: Difference) -> bool:
    return any(is_about(difference, each.words[0]) for each in _older(difference))


def _beside_a_task(difference: Difference) -> bool:
    texts = [s.fields["text"] for s in difference.moment.new if s.name == "STATUSTEXT"]
    return any(
        each.words[0].of("command") in NOT_BESIDE_A_TASK
        and is_about(difference, each.words[0])
        and any(b"not while tasks drive" in text for text in texts)
        for each in refusals(difference, DENIED, NOT_ALLOWED)
    )


def _answer_to_unsent(difference: Difference) -> bool:
    """The rover answers, in the record, what the new core has not passed on to it."""
    old, now = difference.old, difference.now
    if difference.kind is not Kind.MISSING or difference.name != ACK or old is None:
        return False
    number, story = old.fields["command"], difference.moment.story
    answered = [each for each in story.heard(ACK, since=now) if each.of("command") == number]
    to = old.fields["target_system"], old.fields["target_component"]
    refused = any(
        sent.name == ACK and sent.way == old.way and sent.fields["command"] == number
        for _, sent in story.new(ACK, since=now - ANSWERS)
    )
    sent_old, sent_new = (
        any(s.fields["command"] == number and s.source == to for _, s in found)
        for found in (
            story.old(*COMMANDS, since=now - ANSWERS),
            story.new(*COMMANDS, since=now - ANSWERS),
        )
    )
    return bool(answered) and refused and sent_old and not sent_new


def _asks_the_same(one: Sent, other: Sent) -> bool:
    names = ("command", "param1", "param2", "param3", "param4", "target_system", "target_component")
    return all(repr(one.fields[name]) == repr(other.fields[name]) for name in names)


def _shared_question(difference: Difference) -> bool:
    """Two clients ask a rover the same: it is asked once, and both get its answer."""
    sent, now, story = difference.new or difference.old, difference.now, difference.moment.story
    if sent is None:
        return False
    if difference.name == "COMMAND_LONG" and sent.fields["command"] == REQUEST_MESSAGE:
        asked = story.new("COMMAND_LONG", since=now - ANSWERS)
        is_asked = any(_asks_the_same(each, sent) for _, each in asked)
        return difference.kind is Kind.MISSING and sent.source != OURS and is_asked
    if difference.name != ACK or sent.fields["command"] != REQUEST_MESSAGE:
        return False
    if difference.kind is Kind.ADDED:  # at the other client's answer
        return any(e.of("command") == REQUEST_MESSAGE for e in story.heard(ACK, since=now))
    before = story.new(ACK, since=now - ANSWERS)
    is_answered = any(s.way == sent.way and s.fields == sent.fields for _, s in before)
    return difference.kind is Kind.MISSING and is_answered


def _halts_first(difference: Difference) -> bool:
    """The same packets in another order, at an instant at which a halt came after other words."""
    moment = difference.moment
    heard = [*moment.story.heard(*COMMANDS, "SET_MODE", since=difference.now)][::-1]
    first = next((n for n, each in enumerate(heard) if not is_halt(each)), len(heard))
    comes_later = any(is_halt(each) for each in heard[first:])
    return comes_later and _told(moment.old) == _told(moment.new)


def _told(packets: Sequence[Sent]) -> Counter[str]:
    """Count what is said, in whatever order, without the field that only one core knows."""
    return Counter(
        repr((s.way, s.name, s.source, {k: v for k, v in s.fields.items() if k != "halt_epoch"}))
        for s in packets
        if s.name != "TIMESYNC"
    )


def _released_waits(difference: Difference) -> bool:
    """A held task that is released under a pause waits for the continue."""
    moment = difference.moment
    is_released = any(
        each.of("command") == RELEASE
        for each in moment.story.heard(*COMMANDS, since=difference.now)
    )
    words = b"released, and goes on when continued"
    return is_released and any(words in s.fields.get("text", b"") for s in moment.new)


def _is_policy(difference: Difference) -> bool:
    """A client's message that the table of policy lets nobody send to a rover so."""
    old = difference.old
    if difference.kind is not Kind.MISSING or old is None or old.source == OURS:
        return False
    heard = difference.moment.story.heard(since=difference.now)
    is_passed_on = any(each.packet.content[:3] == old.content[:3] for each in heard)
    row = row_of_message(old.message_id)
    return is_passed_on and row.kind in (PolicyKind.MOTION, PolicyKind.ACTION, PolicyKind.GO)


def _borrowed(difference: Difference) -> bool:
    """Who calls itself the server or a rover is not heard, so nothing is shown to it either."""
    old, story = difference.old, difference.moment.story
    if difference.kind is not Kind.MISSING or old is None:
        return False
    said = [each for each in story.heard() if each.packet.way == old.way]
    borrowed = [each for each in said if each.packet.source in (OURS, (1, 1), (1, 191))]
    return bool(said) and len(said) == len(borrowed)


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
        "Whether it is older than a halt is looked at first.",
        _older_than_halt_and_refused_before,
    ),
    Intended(
        "a held task that is released under a pause waits for the continue",
        "A release, also a submitter's, does not undo what somebody else has paused.",
        _released_waits,
        After.DIVERGES,
    ),
    Intended(
        "no command of its own meaning beside a task",
        "What is not known to be harmless does not reach a rover that a task drives.",
        _beside_a_task,
    ),
    Intended(
        "a message that may move a rover is not passed on",
        "What the policy table takes for motion or action needs a grant, and no task beside it.",
        _is_policy,
    ),
    Intended(
        "nothing is shown to who borrows an address",
        "Who calls itself the server or a rover is heeded by nobody.",
        _borrowed,
    ),
    Intended(
        "the rover's answer to what was not passed on",
        "The rover of the record answers what only the old core had sent it.",
        _answer_to_unsent,
    ),
    Intended(
        "a rover is asked once what two clients ask",
        "Questions of several clients are shared, so that a slow rover can answer them.",
        _shared_question,
    ),
    Intended(
        "halts of one instant come first",
        "What lets a rover stand is seen to before what lets it go, whichever was read first.",
        _halts_first,
    ),
    Intended(
        "a command that never left is answered: busy",
        "The rover was not asked, so it cannot be said to be silent.",
        _busy,
    ),
)
