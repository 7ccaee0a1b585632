"""Intended differences: words of clients that the new core refuses, or answers otherwise."""

from collections import Counter
from collections.abc import Sequence

from mav_tasks.engine.policy import Kind as PolicyKind
from mav_tasks.engine.policy import row_of_message

from .differences import Difference, Kind
from .entries import After, Intended
from .rovers import OURS, REQUEST_MESSAGE, is_of_rover, is_to_rover
from .wire import Sent
from .words import (
    ACK,
    CLEAR,
    COMMANDS,
    DENIED,
    NOT_ALLOWED,
    PAUSE_CONTINUE,
    RATE_LIMITED,
    RELEASE,
    STALE,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    VEHICLE_SILENT,
    Refusals,
    is_about,
    is_halt,
    refusals,
    result_of,
    why_older,
)

DENIED_PLAN = 14  # a MISSION_ACK's type
WINDOW = 60.0  # s: signing.window
KEPT = 61.0  # s for which a wall clock of the record may be old
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


def _continued_nothing(difference: Difference) -> bool:
    """A continue is refused as STALE that had let nothing go: the queue was not paused."""
    found, moment = _older(difference), difference.moment
    if len(found) != 1 or found[0].words[0].of("command") != PAUSE_CONTINUE:
        return False
    word = found[0].words[0]
    texts = [s.fields["text"] for s in moment.old if s.name == "STATUSTEXT"]
    obeyed = [s for s in moment.old if is_to_rover(s) and s not in moment.new]
    only = difference.name in (ACK, "STATUSTEXT") and is_about(difference, word)
    return only and not obeyed and b"Queue continued" not in texts


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
        sum(s.fields["command"] == number and s.source == to for _, s in found)
        for found in (
            story.old(*COMMANDS, since=now - ANSWERS),
            story.new(*COMMANDS, since=now - ANSWERS),
        )
    )
    return bool(answered) and refused and sent_old > sent_new


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
    heard = [*moment.story.heard(since=difference.now)][::-1]
    first = next((n for n, each in enumerate(heard) if not is_halt(each)), len(heard))
    comes_later = any(is_halt(each) for each in heard[first:])
    old, new = moment.old, moment.new
    if difference.kind is Kind.REORDERED and difference.old is not None:
        way = difference.old.way  # whatever else is otherwise at this instant
        old, new = ([s for s in each if s.way == way] for each in (old, new))
    return comes_later and _told(old) == _told(new)


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
        for each in moment.story.heard(*COMMANDS, since=difference.now - 2.0)
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
    sent = old or difference.new  # its wishes for fewer messages do not count either
    if sent is None or difference.kind is Kind.CHANGED or not is_of_rover(sent):
        return False
    said = [each for each in story.heard() if each.packet.way == sent.way]
    borrowed = [each for each in said if is_borrowed(each.packet)]
    return bool(said) and len(said) == len(borrowed)


def _busy(difference: Difference) -> bool:
    """An unsent command: its asker is told that the rover is busy, not that it is silent."""
    sent = difference.new or difference.old
    if sent is None or difference.kind is Kind.REORDERED:
        return False
    old, new = (
        Counter(_answer(each) for each in packets if each.way == sent.way)
        for packets in (difference.moment.old, difference.moment.new)
    )
    gone, come = set(old - new) - {""}, set(new - old) - {""}
    is_it = difference.name in (ACK, "STATUSTEXT") and bool(come | gone)
    return is_it and gone <= {"silent", "unsupported"} and come <= {"busy"}


def _answer(sent: Sent) -> str:
    if sent.name == ACK:
        number = sent.fields["command"]
        if result_of(sent) == (TEMPORARILY_REJECTED, RATE_LIMITED):
            return "busy"
        if result_of(sent) == (TEMPORARILY_REJECTED, VEHICLE_SILENT):
            return "silent"
        is_question = number == REQUEST_MESSAGE
        return "unsupported" if is_question and result_of(sent) == (UNSUPPORTED, 0) else "other"
    if sent.name != "STATUSTEXT":
        return ""
    if sent.fields["text"].endswith(b"is busy, ask again"):
        return "busy"
    return "silent" if b"no answer from vehicle" in sent.fields["text"] else "other"


def _not_queued(difference: Difference) -> bool:
    """A command that the old core had let wait, and the new one has answered: busy."""
    old, now = difference.old, difference.now
    if difference.kind is not Kind.MISSING or old is None or old.name not in COMMANDS:
        return False
    busy = TEMPORARILY_REJECTED, RATE_LIMITED
    return old.source != OURS and any(
        result_of(sent) == busy
        and sent.fields["command"] == old.fields["command"]
        and (sent.fields["target_system"], sent.fields["target_component"]) == old.source
        for _, sent in difference.moment.story.new(ACK, since=now - ANSWERS)
    )


def _borrowed_word(difference: Difference) -> bool:
    """Who calls itself the server or a rover is denied what it asks for."""
    return any(
        is_borrowed(each.words[0].packet) and is_about(difference, each.words[0])
        for each in refusals(difference, DENIED, NOT_ALLOWED)
    )


def is_borrowed(sent: Sent) -> bool:
    """Whether a client's packet claims the address of the server or of a rover."""
    return sent.source in (OURS, (1, 1), (1, 191))


def _late_stick(difference: Difference) -> bool:
    """What moves a rover, and is older than a halt or waited, is not passed on."""
    moment, story = difference.moment, difference.moment.story
    gone = [s for s in moment.old if s.source != OURS and not is_of_rover(s)]
    gone = [s for s in gone if all(s.content[:3] != each.content[:3] for each in moment.new)]
    kinds = PolicyKind.MOTION, PolicyKind.STICKS
    moved = [s for s in gone if row_of_message(s.message_id).kind in kinds]
    words = story.heard(since=difference.now)
    return any(
        why_older(word, story)
        for word in words
        if any(word.packet.content[:3] == sent.content[:3] for sent in moved)
    )


def _overtaken_upload(difference: Difference) -> bool:
    """An upload during which a halt came is refused: what it brings would drive."""
    new = difference.moment.new
    is_told = any(b" came during the upload: " in s.fields.get("text", b"") for s in new)
    return is_told and any(s.name == "MISSION_ACK" and s.fields["type"] == DENIED_PLAN for s in new)


def _other_plan(difference: Difference) -> bool:
    """Who uploads a mission keeps others from missions, not from fences and rally points."""
    story, now = difference.moment.story, difference.now
    counts = list(story.heard("MISSION_COUNT", since=now - 10.0))
    if not counts or counts[0].at != now or counts[0].of("mission_type") == 0:
        return False
    refused = [s for s in difference.moment.old if s.name == "MISSION_ACK"]
    return any(
        s.fields["type"] == DENIED_PLAN and s.fields["mission_type"] != 0 for s in refused
    ) and any(each.of("mission_type") == 0 for each in counts[1:])


def _signed_ahead(difference: Difference) -> bool:
    """Who signs with a clock that is more than a minute ahead is not heard, nor shown anything."""
    old, story = difference.old, difference.moment.story
    if difference.kind is not Kind.MISSING or old is None or story.wall_clock is None:
        return False
    said = [each for each in story.heard() if each.packet.signed_at is not None]
    ahead = [e for e in said if (e.packet.signed_at or 0.0) > story.wall_clock + WINDOW + KEPT]
    is_shown = any(each.packet.way == old.way for each in ahead)
    return is_shown or any(each.packet.content[:3] == old.content[:3] for each in ahead)


def _cleared_at_once(difference: Difference) -> bool:
    """What is called off and stands is over at once."""
    now, moment = difference.now, difference.moment
    heard = moment.story.heard(*COMMANDS, "MISSION_CLEAR_ALL", since=now)
    is_cleared = any(e.name == "MISSION_CLEAR_ALL" or e.of("command") == CLEAR for e in heard)
    texts = [s.fields["text"] for s in (*moment.new, *moment.old) if s.name == "STATUSTEXT"]
    return is_cleared and any(text.endswith(b"cancelled: cleared") for text in texts)


TABLE = (
    Intended(
        "a continue of what runs is refused, STALE",
        "A word older than a halt is refused also where it would have changed nothing.",
        _continued_nothing,
    ),
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
        may_move=True,  # once it is continued; the old core had refused the release
    ),
    Intended(
        "an upload is overtaken by a halt",
        "What was under way when somebody let the rover stand is not queued to drive.",
        _overtaken_upload,
        After.DIVERGES,
    ),
    Intended(
        "an upload keeps others from plans of its type only",
        "Fences and rally points are separate plans; they do not wait for a mission.",
        _other_plan,
        After.DIVERGES,
    ),
    Intended(
        "sticks and set-points that are older than a halt, or waited",
        "Nobody holds a stick any more that came late.",
        _late_stick,
        After.DIVERGES,
    ),
    Intended(
        "what is cleared and stands is over at once",
        "A task that does not move its rover need not be seen to stand.",
        _cleared_at_once,
        After.DIVERGES,
        told_within=10.0,
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
        "who borrows an address is denied",
        "Who calls itself the server or a rover is heeded by nobody.",
        _borrowed_word,
    ),
    Intended(
        "nobody signs ahead of the clock",
        "Who signs more than a minute ahead could keep right clocks out.",
        _signed_ahead,
        After.DIVERGES,
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
    Intended(
        "four commands of one client wait for a rover, not sixteen",
        "So that one client alone does not fill the lane of a command; the others are told: busy.",
        _not_queued,
    ),
)
