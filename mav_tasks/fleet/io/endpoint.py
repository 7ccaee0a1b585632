"""Where a gateway answers the pings of the others."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Endpoint:
    """The IP address and UDP port of the gateway that has this epoch."""

    epoch: int
    host: str
    port: int
