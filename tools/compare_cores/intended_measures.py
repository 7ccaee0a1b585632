"""Intended differences: what a rover's measures tell, and of when, by its own clock."""

import re

from .differences import Difference, Kind
from .entries import After, Intended, only_one
from .motion import SETPOINTS, moves
from .rovers import (
    JITTER,
    LATE,
    asks_identity,
    delays,
    has_restarted,
    heartbeat,
    is_ahead,
    is_armed,
    is_hold,
    is_silent,
    is_to_rover,
)
from .wire import Sent
from .words import REPOSITION

NEARLY_LOST = 0.9  # s without a measure; after 1.0 its position is lost, from when it was made
RESTARTS = 35.0  # s in which a rover that restarts is asked for HOLD, 30 times
JITTERS = 4.0  # s in which a rover comes to stand
STATUS = ("STATUSTEXT", "TASK_STATUS", "TASK_QUEUE_STATUS", "MISSION_CURRENT")
NEWS = re.compile(
    rb"Task \d+ (started|done|cancelled.*|paused: position lost|waits: no position|held: .*)|"
    rb"Rover \d+ moves though .*|Rover \d+ did not stand.*"
)
ENDS = re.compile(rb"Task \d+ (started|done|cancelled.*)")


def _late_measures(difference: Difference) -> bool:
    """What a rover does, it says with a delay: the new core counts that, and waits or stands."""
    moment = difference.moment
    if not _is_of_standing(difference):
        return False
    systems = {int(s.fields["target_system"]) for s in _to_rovers(difference)}
    systems |= {s.source[0] for s in (*moment.old, *moment.new) if s.name == "STATUSTEXT"}
    for system in systems:
        late = delays(system, moment.story, since=difference.now - 20.0)
        if late and (max(late[:3]) > LATE or is_ahead(system, moment.story)):
            return True
        if is_silent(system, moment.story, now=difference.now, for_=NEARLY_LOST):
            return True
    return False


def _jitter(difference: Difference) -> bool:
    """When a rover stands is told by its own clock: a task ends some ticks earlier or later."""
    moment, now = difference.moment, difference.now
    if not _is_of_standing(difference) or difference.kind is Kind.CHANGED:
        return False
    told = [s for s in (*moment.old, *moment.new) if s.name == "STATUSTEXT"]
    if any(NEWS.fullmatch(s.fields["text"]) and not ENDS.fullmatch(s.fields["text"]) for s in told):
        return False
    for sent in (*moment.old, *moment.new):
        if sent.name in STATUS or is_to_rover(sent):
            system = int(sent.fields.get("target_system", 0)) or sent.source[0]
            if sent.name in STATUS:
                system = sent.source[0]
            late = delays(system, moment.story, since=now - JITTERS)
            is_new = has_restarted(system, moment.story, since=now - JITTERS)
            if is_new or (len(late) > 1 and max(late) - min(late) > JITTER):
                return True
    return False


def _is_of_standing(difference: Difference) -> bool:
    """Whether a difference is a packet that lets a rover stand, or news of how a task goes on."""
    sent = difference.new or difference.old
    if sent is None or difference.kind is Kind.REORDERED:
        return False
    if is_to_rover(sent):
        return is_hold(sent)
    moment = difference.moment
    told = [s for s in (*moment.old, *moment.new) if s.name == "STATUSTEXT"]
    news = any(NEWS.fullmatch(s.fields["text"]) for s in told)
    if difference.name == "STATUSTEXT":
        return NEWS.fullmatch(sent.fields["text"]) is not None
    return difference.name in STATUS and news


def _to_rovers(difference: Difference) -> list[Sent]:
    moment = difference.moment
    found = [s for s in (*moment.old, *moment.new) if is_to_rover(s)]
    return [s for s in found if "target_system" in s.fields]


def _restart_seen(difference: Difference) -> bool:
    """A restart is seen by its clock, and not with the first measure: at another message of it."""
    sent = difference.new or difference.old
    if sent is None or not only_one(difference):
        return False
    if difference.name == "STATUSTEXT":
        return bool(sent.fields["text"].endswith(b" restarted"))
    return is_to_rover(sent) and sent.name == "COMMAND_LONG" and asks_identity(sent)


def _stays_disarmed(difference: Difference) -> bool:
    """A rover that has restarted counts as disarmed: it is not told to stay at its place."""
    old, story, now = difference.old, difference.moment.story, difference.now
    if difference.kind is not Kind.MISSING or old is None or old.name != "COMMAND_INT":
        return False
    if not is_to_rover(old) or old.fields["command"] != REPOSITION:
        return False
    is_told = any(
        s.fields["text"].endswith(b"restarted")
        for _, s in story.new("STATUSTEXT", since=now - RESTARTS)
    )
    return is_told or not is_armed(heartbeat(old, story))


def _stands_otherwise(difference: Difference) -> bool:
    """A car is asked to stand by a trace of speed while it rolls, and by zero once it does not."""
    old, new = difference.old, difference.new
    if difference.kind is not Kind.CHANGED or old is None or new is None:
        return False
    return is_to_rover(new) and new.name in SETPOINTS and not moves(old) and not moves(new)


TABLE = (
    Intended(
        "how a car is asked to stand",
        "By a trace of its speed while it rolls: how it rolls is told by measures and their age.",
        _stands_otherwise,
    ),
    Intended(
        "a restart is seen by the rover's clock",
        "A measure that is older than the last is a late copy, or a restart: two are asked for.",
        _restart_seen,
        After.MOVED,
        within=6.0,
    ),
    Intended(
        "a rover that is not armed is not told to stay at its place",
        "A restart disarms; what was shown before proves nothing any more.",
        _stays_disarmed,
    ),
    Intended(
        "a rover whose measures come late",
        "How old a measure is, the rover's clock says: what is late does not show that it stands.",
        _late_measures,
        After.DIVERGES,
    ),
    Intended(
        "a task ends some ticks earlier or later",
        "The delay of a net does not count as the rover's: it stands when its clock says so.",
        _jitter,
        After.DIVERGES,
        told_within=1.5,
    ),
)
