"""What a stream link is set to: above all, how long a packet may wait before it is worthless."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LinkLimits:
    """The way to the peers of one side."""

    max_age: float  # s that a packet waits for its turn at the most
    unsent: int  # bytes that the system may keep of one TCP connection without sending them
    send_buffer: int | None  # bytes of a TCP connection sent and not yet confirmed; None: as usual
    give_up: float  # s that a TCP connection may take nothing
    connections: int  # on one link that listens; one more is closed as soon as it is there


#: Towards vehicles four setpoints may wait: a stalled connection must not deliver old ones later.
TO_VEHICLES = LinkLimits(max_age=0.2, unsent=512, send_buffer=8_192, give_up=10.0, connections=256)
#: A client has asked again after a second, and a late answer would be taken for the next one's.
#: Half as many connections as there may be clients: those on datagram links have room as well.
TO_CLIENTS = LinkLimits(max_age=1.0, unsent=4_096, send_buffer=None, give_up=60.0, connections=32)
