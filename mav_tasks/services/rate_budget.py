"""What a link to vehicles carries, shared among those who wish telemetry. Pure arithmetic.

The server's own needs come first and are never thinned. Of what is left nine tenths are for clients
that may command, one tenth for observers: so an operator's wish is never cut for an observer's, and
an observer's has something. Where wishes cost more than that, all of them become slower alike.
"""

from collections.abc import Mapping

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.packet import CRC, HEADER_V2
from mav_tasks.services.interval_requester import SHORTEST, WANTED

#: of what a line carries, for what is streamed: answers, parameters and the way up need the rest
STREAMED_SHARE = 0.7
OBSERVERS_SHARE = 0.1  # of what the server does not need itself
OBSERVERS_SHORTEST = 0.1  # s between messages; ``clients.stream_interval`` is as much
SLOWEST = 10.0  # s; what would come less often is not asked for
LARGEST = 255  # bytes of a payload

Intervals = dict[int, float]  # s between messages, by message id


def size_of(message_id: int) -> int:
    """Return the bytes that a message has on the wire, at the most."""
    kind = m.ALL.get(message_id)
    return HEADER_V2 + CRC + (LARGEST if kind is None else kind.unpacker.size)


#: bytes a second that the server needs of one vehicle
OWN = sum(size_of(number) / interval for number, interval in WANTED.items())


def spare_of(budget: float, capacity: float | None, *, vehicles: int) -> float:
    """Return the bytes a second that are left for each of so many vehicles behind one endpoint.

    ``budget`` as configured, ``capacity`` of the line if it is known.
    """
    if capacity is not None:
        budget = min(budget, STREAMED_SHARE * capacity)
    return max(0.0, budget / vehicles - OWN)


def granted(commanding: Intervals, observing: Intervals, *, spare: float) -> Intervals:
    """Return what a vehicle is asked for beyond the server's own needs."""
    own = {number: 1 / interval for number, interval in WANTED.items()}
    rates = own.copy()
    _raise(rates, commanding, shortest=SHORTEST, most=(1 - OBSERVERS_SHARE) * spare)
    _raise(rates, observing, shortest=OBSERVERS_SHORTEST, most=OBSERVERS_SHARE * spare)
    return {
        number: round(1 / rate, 3) for number, rate in rates.items() if rate > own.get(number, 0.0)
    }


def _raise(
    rates: dict[int, float], wishes: Mapping[int, float], *, shortest: float, most: float
) -> None:
    extra = {
        number: 1 / max(interval, shortest) - rates.get(number, 0.0)
        for number, interval in wishes.items()
    }
    extra = {number: rate for number, rate in extra.items() if rate > 0}
    cost = sum(rate * size_of(number) for number, rate in extra.items())
    part = min(1.0, most / cost) if cost else 0.0
    for number, rate in extra.items():
        raised = rates.get(number, 0.0) + part * rate
        if raised >= 1 / SLOWEST or number in rates:
            rates[number] = raised
