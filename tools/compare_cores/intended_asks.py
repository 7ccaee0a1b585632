"""Intended differences: what the server itself asks a rover, and when."""

from math import isclose

from mav_tasks.services.interval_requester import WANTED

from .differences import Difference, Kind
from .entries import After, Intended

SET_MESSAGE_INTERVAL = 511
OURS = (250, 191)
NANO, MICRO = 1e9, 1e6


def _asks_time(difference: Difference) -> bool:
    """One TIMESYNC beside each heartbeat of ours, with the time of the run."""
    new = difference.new
    if difference.kind is not Kind.ADDED or difference.name != "TIMESYNC" or new is None:
        return False
    beside = [each for each in difference.moment.new if each.way == new.way]
    asked = [each for each in beside if each.name == "TIMESYNC"]
    is_at_beat = any(each.name == "HEARTBEAT" and each.source == new.source for each in beside)
    is_now = isclose(new.fields["ts1"], difference.now * NANO, abs_tol=1.0)
    return is_at_beat and len(asked) == 1 and is_now and new.fields["tc1"] == 0


def _asks_wished_rate(difference: Difference) -> bool:
    """A rate that only clients wish: not what the server needs to drive by."""
    sent = difference.new or difference.old
    if difference.kind not in (Kind.MISSING, Kind.ADDED) or sent is None:
        return False
    if difference.name != "COMMAND_LONG" or sent.fields["command"] != SET_MESSAGE_INTERVAL:
        return False
    needed = WANTED.get(int(sent.fields["param1"]))
    interval = sent.fields["param2"] / MICRO
    return sent.source == OURS and (needed is None or interval < needed)


def _asks_own_rate(difference: Difference) -> bool:
    """What the server needs is asked for as such where a client's wish for more comes later."""
    sent, story = difference.new, difference.moment.story
    if difference.kind is not Kind.ADDED or difference.name != "COMMAND_LONG" or sent is None:
        return False
    number, interval = sent.fields["param1"], sent.fields["param2"] / MICRO
    if sent.fields["command"] != SET_MESSAGE_INTERVAL or WANTED.get(int(number)) != interval:
        return False
    wished = [*difference.moment.old, *(s for _, s in story.old("COMMAND_LONG"))]
    return any(
        s.fields.get("command") == SET_MESSAGE_INTERVAL
        and s.fields["param1"] == number
        and s.fields["param2"] / MICRO < interval
        for s in wished
        if s.name == "COMMAND_LONG"
    )


def _asks_rates_after_restart(difference: Difference) -> bool:
    """What the server needs is asked for again when a restart is seen: at another moment."""
    sent, now, story = difference.new or difference.old, difference.now, difference.moment.story
    if difference.kind not in (Kind.MISSING, Kind.ADDED) or sent is None:
        return False
    if sent.name != "COMMAND_LONG" or sent.fields["command"] != SET_MESSAGE_INTERVAL:
        return False
    told = [*story.old("STATUSTEXT", since=now - 6.0), *story.new("STATUSTEXT", since=now - 6.0)]
    is_told = any(s.fields["text"].endswith(b" restarted") for _, s in told)
    return is_told and WANTED.get(int(sent.fields["param1"])) == sent.fields["param2"] / MICRO


TABLE = (
    Intended(
        "TIMESYNC beside our heartbeats",
        "How old a measure is, the rover's clock says; what the way takes, an exchange tells.",
        _asks_time,
    ),
    Intended(
        "rates that clients wish, asked for at another time",
        "Wishes are taken all together, and 16 at once, then one a second leave.",
        _asks_wished_rate,
        After.MOVED,
        within=120.0,
        owes=(Kind.MISSING,),
    ),
    Intended(
        "rates that we need come before clients' wishes",
        "Nobody's wish keeps back what the server drives by.",
        _asks_own_rate,
    ),
    Intended(
        "rates that we need, asked for again at another time after a restart",
        "The restart was seen at another message.",
        _asks_rates_after_restart,
        After.MOVED,
        within=6.0,
        owes=(Kind.MISSING,),
    ),
)
