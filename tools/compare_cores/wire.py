"""Packets as anybody may see them: decoded by layouts of whichever revision sent them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from struct import Struct, calcsize, unpack
from typing import Any

HEADER_V1, HEADER_V2, MAGIC_V2 = 6, 10, 0xFD
SIGNED = 1  # incompatibility flag
SIGNING_EPOCH, SIGNING_TICKS = 1_420_070_400, 100_000.0  # 2015, and ticks of 10 µs
_HEAD = Struct("<BBBBBB")

#: by message id: name, struct format, field names in wire order, numbers of values
Layouts = Mapping[int, Sequence[Any]]


@dataclass(frozen=True)
class Sent:
    """One datagram that a core wanted to send."""

    link: str
    peer: Any
    data: bytes
    is_first: bool
    layouts: Layouts

    @property
    def way(self) -> tuple[str, str]:
        """Where it goes."""
        return self.link, repr(self.peer)

    @cached_property
    def message_id(self) -> int:
        """Give the id of its message."""
        data = self.data
        return int.from_bytes(data[7:10], "little") if data[0] == MAGIC_V2 else data[5]

    @property
    def source(self) -> tuple[int, int]:
        """Give system and component id of its sender."""
        at = 5 if self.data[0] == MAGIC_V2 else 3
        return self.data[at], self.data[at + 1]

    @property
    def seq(self) -> int:
        """Give its sequence number."""
        return self.data[4 if self.data[0] == MAGIC_V2 else 2]

    @property
    def payload(self) -> bytes:
        """Give the payload, perhaps without trailing zeros."""
        start = HEADER_V2 if self.data[0] == MAGIC_V2 else HEADER_V1
        return self.data[start : start + self.data[1]]

    @property
    def signed_at(self) -> float | None:
        """Give when it was signed, in s since 1970, by its signature; None: it is not signed."""
        if self.data[0] != MAGIC_V2 or not self.data[2] & SIGNED:
            return None
        return int.from_bytes(self.data[-12:-6], "little") / SIGNING_TICKS + SIGNING_EPOCH

    @cached_property
    def content(self) -> tuple[Any, ...]:
        """Give all of it but what depends on those before it: number, CRC, signature."""
        is_signed = self.data[0] == MAGIC_V2 and bool(self.data[2] & SIGNED)
        return self.message_id, self.source, self.payload, is_signed, self.is_first

    @property
    def name(self) -> str:
        """Give the message's name, or its id."""
        layout = self.layouts.get(self.message_id)
        return str(layout[0]) if layout else f"message {self.message_id}"

    @cached_property
    def fields(self) -> dict[str, Any]:
        """Give the fields by name; the payload in hex where the message is unknown."""
        layout = self.layouts.get(self.message_id)
        if layout is None:
            return {"payload": self.payload.hex()}
        _, form, names, counts = layout
        values = unpack(form, self.payload[: calcsize(form)].ljust(calcsize(form), b"\0"))
        found: dict[str, Any] = {}
        at = 0
        for name, count in zip(names, counts, strict=True):
            value = values[at] if count == 1 else values[at : at + count]
            found[name] = value.rstrip(b"\0") if isinstance(value, bytes) else value
            at += count
        return found

    def __str__(self) -> str:
        where = f"{self.source[0]}/{self.source[1]} to {self.link} {self.peer}"
        values = ", ".join(f"{name}={value!r}" for name, value in self.fields.items())
        return f"{self.name}({values}) seq {self.seq}, {where}"
