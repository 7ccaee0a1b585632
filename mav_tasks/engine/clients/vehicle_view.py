"""What one client gets of one vehicle's telemetry. MAVLink guide: SET_MESSAGE_INTERVAL, and the
older REQUEST_DATA_STREAM that MAVProxy sends, QGroundControl to ArduPilot too.

The server owns the rates on the vehicle links; what a client asks for is met by leaving messages
out of what is forwarded to it.

How much telemetry a client's way out takes is found out by trying, as there is no other way. While
it is congested no telemetry passes at all, so that answers do not wait behind it. Each congestion
makes the intervals between telemetry messages longer, for all alike: none is left out because its
turn always comes at a bad moment. Without congestion they slowly become shorter again.
"""

from dataclasses import dataclass
from math import exp, inf, log
from typing import NamedTuple

from mav_tasks.engine.services.interval_requester import WANTED

#: What REQUEST_DATA_STREAM names at once, by MAV_DATA_STREAM: message ids, as ArduPilot's rovers
#: have them. ALL are the messages that vehicles send as streams, and only these are thinned:
#: everything else is an answer or an event, of which none may be lost.
GROUPS: dict[int, frozenset[int]] = {
    int(group): frozenset(map(int, ids))
    for group, _, *ids in map(
        str.split,
        """
0  ALL  1 2 24 26 27 29 30 31 32 33 35 36 42 62 65 74 85 87 105 116 129 132 141 147 230 241 331
1  RAW_SENSORS      26 27 29 105 116 129
2  EXTENDED_STATUS  1 24 42 62 87
3  RC_CHANNELS      35 36 65
6  POSITION         32 33
10 EXTRA1           30 31
11 EXTRA2           74
12 EXTRA3           2 132 147 230 241
""".strip().splitlines(),
    )
}
STREAMED = GROUPS[0]
STOPPED = -1  # SET_MESSAGE_INTERVAL param2, and MESSAGE_INTERVAL: the message is not sent
DEFAULT = 0  # SET_MESSAGE_INTERVAL param2: back to the default rate
LONGEST_US = 2**31 - 1  # what MESSAGE_INTERVAL can say
MAX_WISHES = 256  # of one client, for each vehicle
UNCROWDED = 0.02  # s; a wish for more is stretched as if it were for this
GOLDEN = 0.618  # multiples of it are spread evenly between whole numbers
SLACK = 0.7  # of an interval: the jitter of a stream must not halve its rate

WIDEN = 1.5  # by so much longer, at the beginning of a congestion, and for each AGAIN that it lasts
AGAIN = 2.0  # s
RELAX = 0.05  # per second: the part by which intervals shrink
LONGEST = 20.0  # times the interval asked for


@dataclass(slots=True)
class Pace:
    """How fast telemetry may be for one client."""

    #: s between messages that the client has no wish for
    default_interval: float
    #: s between messages of one type, whatever the client wishes
    least: float = 0.0
    has_wishes: bool = False
    is_congested: bool = False
    is_idle: bool = True  #: there was no congestion lately: looked at for each packet
    _factor: float = 1.0
    _at: float = 0.0  # when the factor was that

    def note_congestion(self, is_congested: bool, *, now: float) -> None:
        """Take in that a congestion began, or ended."""
        self._factor = self.factor(now=now)
        if is_congested and not self.is_congested:
            self._factor = min(self._factor * WIDEN, LONGEST)
        self._at, self.is_congested, self.is_idle = now, is_congested, False

    def factor(self, *, now: float) -> float:
        """Return by which factor intervals are longer than asked for, 1 or more."""
        passed = now - self._at
        if self.is_congested:
            return min(self._factor * exp(log(WIDEN) * min(passed / AGAIN, 100.0)), LONGEST)
        factor = max(1.0, self._factor * exp(-RELAX * passed))
        self.is_idle = factor == 1.0
        return factor

    def stretched(self, interval: float, message_id: int, *, now: float) -> float:
        """Return the interval that the way out to the client allows.

        Slightly different ones, so that streams which waited for the end of the same congestion do
        not cause the next one by always coming together.
        """
        factor = self.factor(now=now)
        if factor == 1.0:
            return interval
        return max(interval, UNCROWDED) * factor * (0.8 + 0.4 * (message_id * GOLDEN % 1.0))


class Wish(NamedTuple):
    """What a client wants of one message."""

    interval: float | None  # s; None: not at all
    #: whether who may command wished it, of what the vehicle itself is asked for; None: it is not
    commands: bool | None


class VehicleView:
    """What one client has been sent of one vehicle, and wants of it."""

    def __init__(self, pace: Pace) -> None:
        self._pace = pace
        #: by message
        self.wishes: dict[int, Wish] = {}
        self._last: dict[tuple[int, int], float] = {}  # by component and message
        #: whether it was sent the vehicle's summary since it came
        self.is_informed = False
        self.listed_at = -inf  #: s, when it was last sent all parameters

    def wish(self, message_id: int, interval_us: float, *, commands: bool | None) -> None:
        """Take a client's wish: microseconds, STOPPED or DEFAULT."""
        if interval_us == DEFAULT:
            self.wishes.pop(message_id, None)
        elif message_id in self.wishes or len(self.wishes) < MAX_WISHES:
            self._pace.has_wishes = True
            interval = None if interval_us < 0 else min(interval_us, LONGEST_US) / 1e6
            self.wishes[message_id] = Wish(interval, commands)

    def wish_group(self, group: int, rate: float, *, commands: bool) -> None:
        """Take a client's wish for a MAV_DATA_STREAM: messages a second of each kind, 0 for none.

        The latest wish for a message counts, by whatever means. The vehicle is asked only for what
        it is known to have: it says no aloud to anything else.
        """
        interval_us = 1e6 / rate if rate > 0 else STOPPED
        for message_id in GROUPS.get(group, ()):
            before = self.wishes.get(message_id)
            is_had = None if before is None else before.commands
            is_asked = commands if message_id in WANTED else is_had
            self.wish(message_id, interval_us, commands=is_asked)

    def interval_us(self, message_id: int) -> int:
        """Return the interval in force, in microseconds; STOPPED if none."""
        interval = self._interval(message_id)
        return STOPPED if interval is None else round(interval * 1e6)

    def passes(self, component_id: int, message_id: int, *, now: float) -> bool:
        """Whether a streamed message that just came is sent on to the client."""
        interval, pace = self._interval(message_id), self._pace
        if interval is None or pace.is_congested:
            return False
        if not pace.is_idle:
            interval = pace.stretched(interval, message_id, now=now)
        key = component_id, message_id
        last = self._last.get(key)
        if last is not None and now - last < SLACK * interval:
            return False
        # keeping to the rhythm of the interval makes the long-run rate right in spite of SLACK
        self._last[key] = now if last is None else max(last + interval, now - interval)
        return True

    def _interval(self, message_id: int) -> float | None:
        wish, pace = self.wishes.get(message_id), self._pace
        interval = pace.default_interval if wish is None else wish.interval
        return None if interval is None else max(interval, pace.least)
