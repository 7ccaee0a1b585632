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
        within=30.0,
    ),
)
