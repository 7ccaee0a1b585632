"""What a link to vehicles carries, shared among those who wish telemetry, or ask for anything.

The server's own needs come first and are never thinned. Of what is left nine tenths are for clients
that may command, one tenth for observers: so an operator's wish is never cut for an observer's, and
an observer's has something. Where wishes cost more than that, all of them become slower alike.

A vehicle answers an observer's requests over its own link. A list of all parameters, or a hundred
small requests a second, would delay the telemetry that a task is driven by.
"""

from collections.abc import Hashable
from math import inf

from mav_tasks.basics.latest import keep_latest
from mav_tasks.engine.services.file_transfer import BURST_READ, OPCODE
from mav_tasks.engine.services.interval_requester import SHORTEST, WANTED
from mav_tasks.engine.services.token_bucket import TokenBucket
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.packet import CRC, HEADER_V2, Packet

#: of what a line carries, for what is streamed: answers, parameters and the way up need the rest
STREAMED_SHARE = 0.7
OBSERVERS_SHARE = 0.1  # of what the server does not need itself
OBSERVERS_SHORTEST = 0.1  # s between messages; ``clients.stream_interval`` is as much
SLOWEST = 10.0  # s; what would come less often is not asked for
LARGEST = 255  # bytes of a payload
LIST = 37_000.0  # bytes: a thousand parameters, as an ArduPilot has
LIST_SHARE = 0.3  # of the link, which an ArduPilot uses for a list
SLOW_LIST = 5.0  # s; a link that takes longer for a list is narrow
LEAST = 100.0  # bytes/s for requests on the narrowest link: one or two
WITHIN = 5.0  # s of requests that may come in a burst
OWN_SHARE = 0.25  # of the requests, for one client: its flood leaves room for the others
MOST_CLIENTS = 64  # whose requests are counted

Intervals = dict[int, float]  # s between messages, by message id


def size_of(message_id: int) -> int:
    """Return the bytes that a message has on the wire, at the most."""
    kind = m.ALL.get(message_id)
    return HEADER_V2 + CRC + (LARGEST if kind is None else kind.unpacker.size)


#: bytes a second that the server needs of one vehicle
OWN = sum(size_of(number) / interval for number, interval in WANTED.items())


class LinkBudget:
    """What the link to one endpoint of vehicles carries, and what may be requested over it."""

    def __init__(self, budget: float, capacity: float | None, *, vehicles: int, now: float) -> None:
        """``budget`` as configured, ``capacity`` of the line if it is known, in bytes/s."""
        line = inf if capacity is None else capacity
        self._carries = min(budget, line)
        #: bytes/s that may be requested of each vehicle beyond the server's own needs
        self.spare = max(0.0, min(budget, STREAMED_SHARE * line) / vehicles - OWN)
        rate = max(LEAST, OBSERVERS_SHARE * self.spare * vehicles)
        self._questions = TokenBucket(rate=rate, burst=WITHIN * rate, now=now)
        self._rate = max(LEAST, OWN_SHARE * rate)  # bytes/s, of one client
        self._own: dict[Hashable, TokenBucket] = {}
        self._listed_until = -inf

    def why_not(
        self, who: Hashable, packet: Packet, message: m.Message, *, is_driven: bool, now: float
    ) -> str | None:
        """Return why an observer's request may not be forwarded now, or None if it may."""
        is_file = (
            isinstance(message, m.FileTransferProtocol) and message.payload[OPCODE] == BURST_READ
        )
        if not is_file and not isinstance(message, m.ParamRequestList | m.MissionRequestList):
            size = len(packet.raw) + _size_of_answer(message)
            own, rate = self._own.get(who), self._rate
            own = own or TokenBucket(rate=rate, burst=WITHIN * rate, now=now)
            keep_latest(self._own, who, own, most=MOST_CLIENTS)
            if own.take(tokens=size, now=now) and self._questions.take(tokens=size, now=now):
                return None
            return "may not send so many requests over a slow link"
        takes = LIST / (LIST_SHARE * self._carries)
        if is_driven and takes > SLOW_LIST:
            return "may not ask for a list over a slow link during a task"
        if now < self._listed_until:
            return "may ask for only one list at a time over a slow link"
        self._listed_until = now + takes
        return None


def granted(commanding: Intervals, observing: Intervals, *, spare: float) -> Intervals:
    """Return what a vehicle is asked for beyond the server's own needs."""
    own = {number: 1 / interval for number, interval in WANTED.items()}
    rates = dict(own)
    for wishes, shortest, share in (
        (commanding, SHORTEST, 1 - OBSERVERS_SHARE),
        (observing, OBSERVERS_SHORTEST, OBSERVERS_SHARE),
    ):
        extra = {
            number: 1 / max(interval, shortest) - rates.get(number, 0.0)
            for number, interval in wishes.items()
        }
        extra = {number: rate for number, rate in extra.items() if rate > 0}
        cost = sum(rate * size_of(number) for number, rate in extra.items())
        part = min(1.0, share * spare / cost) if cost else 0.0
        for number, rate in extra.items():
            raised = rates.get(number, 0.0) + part * rate
            if raised >= 1 / SLOWEST or number in rates:
                rates[number] = raised
    return {
        number: round(1 / rate, 3) for number, rate in rates.items() if rate > own.get(number, 0.0)
    }


def _size_of_answer(message: m.Message) -> int:
    """Return the bytes of a vehicle's answer to a request, at most."""
    match message:
        case m.CommandLong() | m.CommandInt():
            shown = message.param1
            asked = size_of(int(shown)) if 0 <= shown < 2**24 else 0
            return size_of(m.CommandAck.id) + asked
        case m.ParamRequestRead():
            return size_of(m.ParamValue.id)
        case _:
            return size_of(message.id)
