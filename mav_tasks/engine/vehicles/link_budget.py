"""What the link to one endpoint of vehicles carries, and what observers may request over it.

The vehicle answers an observer's requests over its own link. A list of all parameters, or a hundred
small requests a second, would delay the telemetry that a task is driven by.
"""

from collections.abc import Hashable
from math import inf

from mav_tasks.latest import keep_latest
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services import file_transfer
from mav_tasks.services.rate_budget import OBSERVERS_SHARE, size_of, spare_of
from mav_tasks.services.token_bucket import TokenBucket

LIST = 37_000.0  # bytes: a thousand parameters, as an ArduPilot has
LIST_SHARE = 0.3  # of the link, which an ArduPilot uses for a list
SLOW_LIST = 5.0  # s; a link that takes longer for a list is narrow
LEAST = 100.0  # bytes/s for requests on the narrowest link: one or two
WITHIN = 5.0  # s of requests that may come in a burst
OWN_SHARE = 0.25  # of the requests, for one client: its flood leaves room for the others
MOST_CLIENTS = 64  # whose requests are counted


class LinkBudget:
    """The budget of one endpoint; ``budget`` as configured, ``capacity`` in bytes/s."""

    def __init__(self, budget: float, capacity: float | None, *, vehicles: int, now: float) -> None:
        self._carries = budget if capacity is None else min(budget, capacity)
        #: bytes/s that may be requested of each vehicle beyond the server's own needs
        self.spare = spare_of(budget, capacity, vehicles=vehicles)
        rate = max(LEAST, OBSERVERS_SHARE * self.spare * vehicles)
        self._questions = TokenBucket(rate=rate, burst=WITHIN * rate, now=now)
        self._rate = max(LEAST, OWN_SHARE * rate)  # bytes/s, of one client
        self._own: dict[Hashable, TokenBucket] = {}
        self._listed_until = -inf

    def why_not(
        self,
        who: Hashable,
        packet: Packet,
        message: m.Message,
        *,
        is_driven: bool,
        now: float,
    ) -> str | None:
        """Return why an observer's request may not be forwarded now, or None if it may."""
        if not _asks_for_much(message):
            size = len(packet.raw) + _size_of_answer(message)
            own = self._own.get(who) or TokenBucket(
                rate=self._rate, burst=WITHIN * self._rate, now=now
            )
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


def _asks_for_much(message: m.Message) -> bool:
    is_file = isinstance(message, m.FileTransferProtocol) and file_transfer.is_burst(message)
    return is_file or isinstance(message, m.ParamRequestList | m.MissionRequestList)


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
