"""Limits of stream links: above all, how long a packet may wait before it is dropped."""

from dataclasses import dataclass
from math import inf


@dataclass(frozen=True, slots=True)
class LinkLimits:
    """Limits of the links to one side, clients or vehicles."""

    max_age: float  # s, maximum wait of a packet in the queue
    unsent: int  # bytes per TCP connection that the system may hold unsent (TCP_NOTSENT_LOWAT)
    send_buffer: int | None  # bytes of a TCP connection's SO_SNDBUF; None: the system's default
    give_up: float  # s without acknowledgement, after which TCP closes (TCP_USER_TIMEOUT)
    connections: int  # on one listening link; SPARE more may come for ``unheard`` seconds
    unheard: float  # s for a valid packet, on a link that accepts only signed ones


#: Four setpoints to a vehicle may wait: a stalled connection must not deliver old ones later.
#: A bridge keeps its connection while its rover is switched off: it has any time for a packet.
TO_VEHICLES = LinkLimits(
    max_age=0.2, unsent=512, send_buffer=8_192, give_up=10.0, connections=256, unheard=inf
)
#: After a second a client has repeated its request, and would take a late answer for the answer to
#: a later one. At most half of all clients may be TCP connections: the rest is for UDP clients.
TO_CLIENTS = LinkLimits(
    max_age=1.0, unsent=4_096, send_buffer=None, give_up=60.0, connections=32, unheard=5.0
)
