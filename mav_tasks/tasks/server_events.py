"""What happens to the server itself, beside its tasks: parameters that were set, and signatures."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ParameterSet:
    """A setting was changed by a client, in the unit of its parameter; None: as configured."""

    name: str
    value: float | None
    actor: str
    at: float

    def __str__(self) -> str:
        value = "as configured" if self.value is None else f"{self.value:g}"
        return f"parameter {self.name}: {value}, by {self.actor}"


@dataclass(frozen=True, slots=True)
class SignatureTime:
    """The time of the last signed packet that was accepted of one sender, in 10 µs since 2015.

    ``key`` is the fingerprint of the key that it was signed with.
    """

    key: str
    link_id: int
    system_id: int
    component_id: int
    timestamp: int


@dataclass(frozen=True, slots=True)
class SignaturesSeen:
    """Up to which times signatures are used up, so that none is accepted twice.

    ``gone`` are senders of which nothing is remembered any more; ``signed_until``: no signature of
    our own is later than this. Kept, but no part of the journal: there are many.
    """

    times: tuple[SignatureTime, ...]
    gone: tuple[SignatureTime, ...]
    signed_until: int
    at: float

    def __str__(self) -> str:
        return f"signatures: {len(self.times)} senders heard"


@dataclass(frozen=True, slots=True)
class SignatureRefused:
    """A packet that was signed well, for another time than the server's, was not looked at.

    ``seconds`` is how long before the server's time it was signed; negative: after it.
    """

    actor: str
    seconds: float
    at: float

    def __str__(self) -> str:
        when = f"{abs(self.seconds):.0f} s {'before' if self.seconds > 0 else 'after'}"
        return (
            f"{self.actor} refused: signed {when} the time of this server. Set both clocks right;"
            " if they are, it was held back or replayed"
        )
