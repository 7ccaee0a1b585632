"""Intended differences: how a rover is made to stand, and how it is taken."""

import re
from itertools import pairwise

from .differences import Difference, Kind
from .entries import After, Intended, only_one
from .ledger import said
from .motion import HOLD_MODES, asks_hold, moves, stands
from .rovers import (
    ARM,
    PX4,
    arms_or_takes,
    asks_heartbeat,
    heartbeat,
    heartbeats,
    is_armed,
    is_hold,
    is_to_rover,
)
from .story import STOOD_STILL, Story
from .wire import Sent
from .words import CLEAR, PAUSE_CONTINUE, SET_MODE, why_older

GAP = 1.5  # s without a heartbeat: one was lost
GAP_ENDS = 6.0  # s after which HOLD is asked for at the latest
REPEATS = 0.35  # s after which HOLD is repeated
SHOWN = 3.0  # s in which what was asked for shows
LATE_MODE = 5.0  # s in which a mode or an arming may show that has left before a halt
ASKED = 60.0  # s in which a mode may show that only the old core has asked for
RESTARTS = 35.0  # s in which a rover that restarts is asked for HOLD, 30 times
DISARMED = re.compile(rb"Task \d+ waits: disarmed; .*")
SHOWS_LATE = re.compile(rb"Rover \d+ shows \w+, asked for before it was to")
TAKEN = re.compile(rb"taken over: mode is (\w+)")


def _in_gap(difference: Difference) -> bool:
    """HOLD that the old core asks for in a gap, and the new one once a heartbeat has come."""
    sent, now, story = difference.new or difference.old, difference.now, difference.moment.story
    if sent is None or not only_one(difference) or not is_to_rover(sent) or not is_hold(sent):
        return False
    if difference.kind is Kind.MISSING:
        beat = heartbeat(sent, story)
        return beat is None or now - beat.at > GAP
    was_asked = any(said(s) == said(sent) for _, s in story.old(sent.name, since=now - GAP_ENDS))
    return was_asked and _had_gap(sent, story, now=now)


def _had_gap(sent: Sent, story: Story, *, now: float) -> bool:
    beats = [each.at for each in heartbeats(sent, story, since=now - 30.0)]
    ends = [now, *beats]
    return (
        any(one - other > GAP for one, other in pairwise(ends) if now - one <= GAP_ENDS)
        or not beats
    )


def _shifted(difference: Difference) -> bool:
    """HOLD and standing set-points that both cores repeat, each from its own first one on."""
    sent, now, story = difference.new or difference.old, difference.now, difference.moment.story
    if sent is None or not only_one(difference) or not is_to_rover(sent) or not is_hold(sent):
        return False
    others = story.new if difference.kind is Kind.MISSING else story.old
    if asks_heartbeat(sent):  # once HOLD was answered
        return any(asks_hold(s) for _, s in story.new("COMMAND_LONG", since=now - SHOWN))
    return any(said(s) == said(sent) for _, s in others(sent.name, since=now - REPEATS))


def _taken_as_asked(difference: Difference) -> bool:
    """A mode shows that only the old core has asked for: the new one takes it for somebody's."""
    new, now, story = difference.new, difference.now, difference.moment.story
    texts = [s.fields["text"] for s in difference.moment.new if s.name == "STATUSTEXT"]
    if new is None or not any(TAKEN.search(text) for text in texts):
        return False
    beat = next((each for each in story.heard("HEARTBEAT", since=now)), None)
    if beat is None:
        return False
    old, ours = (
        {
            (s.fields["param2"], s.fields["param3"])
            for _, s in found
            if is_to_rover(s) and (asks_hold(s) or arms_or_takes(s))
        }
        for found in (
            story.old("COMMAND_LONG", since=now - ASKED),
            story.new("COMMAND_LONG", since=now - SHOWN),
        )
    )
    return bool(old - ours)


def _own_mode_late(difference: Difference) -> bool:
    """Our mode shows late, after we have asked for HOLD: in doubt it is a person's."""
    now, moment = difference.now, difference.moment
    if not any(TAKEN.search(text) for text in _texts(difference)):
        return False
    sent = [s for _, s in moment.story.new("COMMAND_LONG", since=now - LATE_MODE)]
    asks = [s for s in sent if is_to_rover(s) and (asks_hold(s) or arms_or_takes(s))]
    return bool(asks) and asks_hold(asks[0]) and any(arms_or_takes(s) for s in asks)


def _parked(difference: Difference) -> bool:
    """A person drove an armed rover while tasks waited, and shows HOLD now: parked, it stays."""
    now, story = difference.now, difference.moment.story
    if b"Queue paused: takeover" not in _texts(difference):
        return False
    beats = [each for each in story.heard("HEARTBEAT", since=now - 5.0) if each.of("autopilot") < 8]
    modes = {each.of("custom_mode") for each in beats}
    is_ours = any(is_to_rover(s) and moves(s) for _, s in story.new(since=now - 1.0))
    return len(modes) > 1 and any(map(is_armed, beats)) and not is_ours


def _pauses_taken(difference: Difference) -> bool:
    """A pause also stops a rover that moves without a task, or was taken over: by HOLD."""
    now, moment = difference.now, difference.moment
    paused = any(
        each.of("command") == PAUSE_CONTINUE and each.of("param1") == 0.0
        for each in moment.story.heard("COMMAND_LONG", "COMMAND_INT", since=now)
    )
    asked = [s for s in moment.new if is_to_rover(s) and asks_hold(s)]
    return paused and any(s.content not in [each.content for each in moment.old] for s in asked)


def _stays_as_disarmed(difference: Difference) -> bool:
    """What somebody has disarmed is not armed for a task before a continue."""
    now, story = difference.now, difference.moment.story
    words = list(story.heard("COMMAND_LONG", "COMMAND_INT", since=now - ASKED))
    disarmed = any(each.of("command") == ARM and each.of("param1") == 0.0 for each in words)
    waits = any(DISARMED.fullmatch(text) for text in _texts(difference))
    takes = any(is_to_rover(s) and is_hold(s) for s in difference.moment.old)
    return disarmed and waits and (takes or difference.kind is Kind.CHANGED)


def _older_mode(difference: Difference) -> bool:
    """A SET_MODE that is older than a halt is refused: it has no acknowledgement, but a text."""
    now, story = difference.now, difference.moment.story
    words = story.heard("SET_MODE", since=now)
    told = any(b"came since: if you st" in t or b"it waited while" in t for t in _texts(difference))
    return told and any(why_older(each, story) for each in words)


def _late_mode(difference: Difference) -> bool:
    """A mode shows that a client had asked for before a halt: HOLD is asked for again."""
    now, story = difference.now, difference.moment.story
    asked = any(
        each.name == "SET_MODE" or each.of("command") == SET_MODE
        for each in story.heard("SET_MODE", "COMMAND_LONG", since=now - 2 * LATE_MODE)
    )
    return asked and any(SHOWS_LATE.match(text) for text in _texts(difference))


def _late_arming(difference: Difference) -> bool:
    """A rover shows armed by what had left before it was to be disarmed: disarmed again."""
    now, story = difference.now, difference.moment.story
    disarms = any(
        each.of("command") == ARM and each.of("param1") == 0.0
        for each in story.heard("COMMAND_LONG", "COMMAND_INT", since=now - LATE_MODE - 1.0)
    )
    return disarms and any(b"is armed by a word from before" in t for t in _texts(difference))


def _texts(difference: Difference) -> list[bytes]:
    return [s.fields["text"] for s in difference.moment.new if s.name == "STATUSTEXT"]


def _clears_driven(difference: Difference) -> bool:
    """A queue is cleared while a client drives by set-points: HOLD, not zeros alone."""
    now, moment = difference.now, difference.moment
    cleared = any(
        each.of("command") == CLEAR for each in moment.story.heard("COMMAND_LONG", since=now)
    )
    holds = any(asks_hold(s) for s in moment.new if is_to_rover(s))
    return bool(cleared and holds)


def _shown_unasked(difference: Difference) -> bool:
    """What shows is not asked for again, though its answer was lost."""
    old, now, story = difference.old, difference.now, difference.moment.story
    if difference.kind is not Kind.MISSING or old is None or not is_to_rover(old):
        return False
    asks = arms_or_takes(old) or asks_heartbeat(old)
    asked = any(arms_or_takes(s) for _, s in story.new("COMMAND_LONG", since=now - SHOWN))
    beats = story.heard("HEARTBEAT", since=now - SHOWN)
    source = old.fields["target_system"], 1
    return asks and asked and any(is_armed(b) for b in beats if b.packet.source == source)


def _holds_restarted(difference: Difference) -> bool:
    """One that restarts while it is asked for HOLD is asked on."""
    new, now, story = difference.new, difference.now, difference.moment.story
    if difference.kind is not Kind.ADDED or new is None:
        return False
    if not is_to_rover(new) or not is_hold(new):
        return False
    is_told = any(
        s.fields["text"].endswith(b"restarted")
        for _, s in story.new("STATUSTEXT", since=now - RESTARTS)
    )
    asked = any(asks_hold(s) for _, s in story.new("COMMAND_LONG", since=now - RESTARTS))
    return is_told and asked


def _insists(difference: Difference) -> bool:
    """HOLD is asked for again while the rover still shows the mode that it was to leave."""
    new, now, story = difference.new, difference.now, difference.moment.story
    if difference.kind is not Kind.ADDED or new is None:
        return False
    if not is_to_rover(new) or not is_hold(new):
        return False
    asked = any(
        asks_hold(s) and s.way == new.way for _, s in story.new("COMMAND_LONG", since=now - SHOWN)
    )
    hold = [s for _, s in story.old("COMMAND_LONG") if asks_hold(s) and s.way == new.way]
    return asked and bool(hold) and not _shows_hold(difference)


def _shows_hold(difference: Difference) -> bool:
    sent = difference.new or difference.old
    assert sent is not None
    beat = heartbeat(sent, difference.moment.story)
    if beat is None:
        return False
    mode = int(beat.of("custom_mode"))
    main, sub = (mode >> 16 & 0xFF, mode >> 24) if mode > 0xFFFF else (mode, 0)
    return (float(main), float(sub)) in HOLD_MODES


def _slept(difference: Difference) -> bool:
    """After the machine has slept a PX4 gets no zero: it would end its failsafe's HOLD."""
    old, moment = difference.old, difference.moment
    if difference.kind is not Kind.MISSING or old is None or not is_to_rover(old):
        return False
    beat = heartbeat(old, moment.story) if stands(old) else None
    is_px4 = beat is not None and beat.of("autopilot") == PX4
    return is_px4 and moment.story.silence > STOOD_STILL


def _goes_first(difference: Difference) -> bool:
    """While HOLD is asked for, commands leave before set-points that wait."""
    new, now, story = difference.new, difference.now, difference.moment.story
    if difference.kind is not Kind.CHANGED or new is None or difference.fields:
        return False
    asked = any(asks_hold(s) for _, s in story.new("COMMAND_LONG", since=now - RESTARTS))
    return is_to_rover(new) and new.is_first and asked


TABLE = (
    Intended(
        "HOLD waits for a heartbeat after a gap",
        "Who has taken the rover in a gap shows in its next heartbeat; until then zeros go on.",
        _in_gap,
        After.MOVED,
        within=GAP_ENDS,
        owes=(),
    ),
    Intended(
        "a mode shows that only the old core has asked for",
        "The rover of the record obeys the old core: to the new one it is somebody's takeover.",
        _taken_as_asked,
        After.DIVERGES,
    ),
    Intended(
        "HOLD is repeated at other ticks",
        "Both cores have just asked for it, and repeat it until it shows.",
        _shifted,
    ),
    Intended(
        "our own mode that shows late is taken for a person's",
        "HOLD was asked for since; which came first is in doubt, and doubt lets a rover stand.",
        _own_mode_late,
        After.DIVERGES,
    ),
    Intended(
        "commands leave first while HOLD is asked for",
        "One that restarts while it is asked for HOLD is asked on, before whatever waits.",
        _goes_first,
    ),
    Intended(
        "no zero for a PX4 after the machine has slept",
        "It has stopped by its failsafe, which a set-point would end; HOLD keeps it standing.",
        _slept,
    ),
    Intended(
        "parked by a person while tasks wait: the queue is paused",
        "Who drove the rover and sets HOLD parks it; it does not drive off before a continue.",
        _parked,
        After.DIVERGES,
    ),
    Intended(
        "a pause stops a rover that was taken over, or moves without a task",
        "Who pauses means that it stands, whoever drives it.",
        _pauses_taken,
        After.DIVERGES,
    ),
    Intended(
        "a rover that was disarmed is armed after a continue only",
        "Also one that was told so while it was not armed: nobody else arms it for a task.",
        _stays_as_disarmed,
        After.DIVERGES,
    ),
    Intended(
        "a SET_MODE older than a halt is refused",
        "What holds beats every older word that lets go, also one that is not acknowledged.",
        _older_mode,
        After.DIVERGES,
    ),
    Intended(
        "a mode that was asked for before a halt and shows after it is undone",
        "The net has brought the two to the rover in the wrong order.",
        _late_mode,
        After.DIVERGES,
    ),
    Intended(
        "armed by a word from before a disarming: disarmed again",
        "What had left before a disarming arms nothing after it.",
        _late_arming,
        After.DIVERGES,
    ),
    Intended(
        "a client drives while a queue is cleared: HOLD",
        "A set-point of it that comes late would drive the rover on.",
        _clears_driven,
        After.DIVERGES,
    ),
    Intended(
        "what shows is not asked for again",
        "Asked again, mode and arming would undo what a person does meanwhile.",
        _shown_unasked,
    ),
    Intended(
        "a rover that restarts while it is asked for HOLD is asked on",
        "It may as well be late news of its start; HOLD does no harm to one that has restarted.",
        _holds_restarted,
    ),
    Intended(
        "HOLD is asked for until it shows",
        "Up to 30 times, of one that still shows the mode that it was to leave.",
        _insists,
    ),
)
