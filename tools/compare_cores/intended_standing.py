"""Intended differences: how a rover is made to stand, and how it is taken."""

import re

from .differences import Difference, Kind
from .entries import After, Intended
from .motion import HOLD_MODES, asks_hold, moves, stands
from .rovers import (
    JITTER,
    LATE,
    arms_or_takes,
    asks_heartbeat,
    delays,
    heartbeat,
    is_armed,
    is_hold,
    is_to_rover,
)

GAP = 1.5  # s without a heartbeat: one was lost
GAP_ENDS = 6.0  # s after which HOLD is asked for at the latest
SHOWN = 3.0  # s in which what was asked for shows
ASKED = 60.0  # s in which a mode may show that only the old core has asked for
RESTARTS = 35.0  # s in which a rover that restarts is asked for HOLD, 30 times
STATUS = ("STATUSTEXT", "TASK_STATUS", "TASK_QUEUE_STATUS", "MISSION_CURRENT")
TAKEN = re.compile(rb"taken over: mode is (\w+)")


def _only_one(difference: Difference) -> bool:
    return difference.kind in (Kind.MISSING, Kind.ADDED)


def _in_gap(difference: Difference) -> bool:
    """HOLD that the old core asks for in a gap, and the new one once a heartbeat has come."""
    sent, now, story = difference.new or difference.old, difference.now, difference.moment.story
    if sent is None or not _only_one(difference) or not is_to_rover(sent) or not is_hold(sent):
        return False
    if difference.kind is Kind.MISSING:
        beat = heartbeat(sent, story)
        return beat is None or now - beat.at > GAP
    before = story.old(sent.name, since=now - GAP_ENDS)
    return any(s.content[:3] == sent.content[:3] for _, s in before)


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


def _late_measures(difference: Difference) -> bool:
    """What a rover does, it says with a delay: the new core counts that, and waits or stands."""
    sent = difference.new or difference.old
    if sent is None or difference.kind is Kind.REORDERED:
        return False
    system = sent.fields.get("target_system", 0) if is_to_rover(sent) else sent.source[0]
    if not (is_to_rover(sent) and is_hold(sent)) and difference.name not in STATUS:
        return False
    late = delays(int(system), difference.moment.story, since=difference.now - 20.0)
    return bool(late) and max(late[:3]) > LATE


def _jitter(difference: Difference) -> bool:
    """When a rover stands is told by its own clock: a task ends some ticks earlier or later."""
    moment, now = difference.moment, difference.now
    ours = [s for s in (*moment.old, *moment.new) if is_to_rover(s)]
    if not ours or any(moves(s) for s in moment.new if is_to_rover(s)):
        return False
    sent = difference.new or difference.old
    if sent is None or not (stands(sent) if is_to_rover(sent) else difference.name in STATUS):
        return False
    system = int(ours[0].fields.get("target_system", 0))
    late = delays(system, moment.story, since=now - 2.0)
    return bool(late) and max(late) - min(late) > JITTER


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
        asks_hold(s) and s.way == new.way
        for _, s in story.new("COMMAND_LONG", since=now - SHOWN)
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
        "a rover whose measures come late",
        "How old a measure is, the rover's clock says: what is late does not show that it stands.",
        _late_measures,
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
    Intended(
        "a task ends some ticks earlier or later",
        "The delay of a net does not count as the rover's: it stands when its clock says so.",
        _jitter,
        After.DIVERGES,
    ),
)
