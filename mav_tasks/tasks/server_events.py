"""Events of the server itself, not of its tasks: parameters set, and signatures."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ParameterSet:
    """A client changed a setting, in the unit of its parameter; None: as configured."""

    name: str
    value: float | None
    actor: str
    at: float

    def __str__(self) -> str:
        value = "as configured" if self.value is None else f"{self.value:g}"
        return f"parameter {self.name}: {value}, by {self.actor}"


@dataclass(frozen=True, slots=True)
class SignatureTime:
    """Timestamp of the last signed packet accepted from one sender, in 10 µs since 2015.

    ``key`` is the fingerprint of the signing key.
    """

    key: str
    link_id: int
    system_id: int
    component_id: int
    timestamp: int


@dataclass(frozen=True, slots=True)
class SignaturesSeen:
    """The last accepted signature timestamps, stored so that no packet is accepted twice.

    ``gone`` are senders that the server has forgotten. ``signed_until``: no signature of our own is
    later than this. The store keeps these events, but not in the journal: there are too many.
    """

    times: tuple[SignatureTime, ...]
    gone: tuple[SignatureTime, ...]
    signed_until: int
    at: float

    def __str__(self) -> str:
        return f"signatures: {len(self.times)} senders heard"


@dataclass(frozen=True, slots=True)
class SignatureRefused:
    """A packet with a valid signature was dropped because of its timestamp.

    ``seconds`` is how long before the server's time it was signed; negative: after it.
    """

    actor: str
    seconds: float
    at: float

    def __str__(self) -> str:
        when = f"{abs(self.seconds):.0f} s {'before' if self.seconds > 0 else 'after'}"
        return (
            f"packet of {self.actor} refused: signed {when} this server's time. Check both clocks;"
            " if they are right, the packet was delayed or replayed"
        )
