"""A net that tests can degrade per leg, and that records the texts to clients."""

from collections import deque
from contextlib import ExitStack
from dataclasses import dataclass
from math import inf
from typing import Literal

from mav_tasks.links.memory import Conditions, MemoryLink, MemoryNet
from mav_tasks.mavlink.packet import split_datagram
from mav_tasks.shell.in_memory import CLIENT_LINK, VEHICLE_LINK

STATUSTEXT = 253
MESSAGE_ID = slice(7, 10)  # in a MAVLink 2 packet
TEXTS_KEPT = 200

#: which legs to degrade: clients to server, server to rovers, or both
Leg = Literal["client", "rover", "both"]
LEGS = {
    "client": (CLIENT_LINK,),
    "rover": (VEHICLE_LINK,),
    "both": (CLIENT_LINK, VEHICLE_LINK),
}


@dataclass(frozen=True, slots=True)
class Text:
    """A STATUSTEXT that reached a client; longer ones than 50 bytes come in pieces."""

    at: float  # virtual s
    system_id: int
    component_id: int
    text: str

    def __str__(self) -> str:
        return f"{self.at:9.2f} s  {self.system_id}/{self.component_id}  {self.text}"


class LossyNet(MemoryNet):
    """A net that is good at first; ``ways`` degrades the links of one end of the server."""

    def __init__(self, *, seed: int) -> None:
        super().__init__(seed=seed)
        self.ways: dict[str, Conditions] = {}
        self.texts: deque[Text] = deque(maxlen=TEXTS_KEPT)

    def conditions_between(self, source: str, target: str) -> Conditions:
        """Return the conditions between two ends, one of which is the server's."""
        return self.ways.get(source) or self.ways.get(target) or self.conditions

    def arrive(self, link: MemoryLink, source: str, data: bytes) -> None:
        """Record the texts that the server sends to a client."""
        if source == CLIENT_LINK and data[MESSAGE_ID] == STATUSTEXT.to_bytes(3, "little"):
            self.texts += (
                Text(
                    self.now,
                    packet.system_id,
                    packet.component_id,
                    packet.payload[1:51].rstrip(b"\0").decode(errors="replace"),
                )
                for packet in split_datagram(data)
                if packet.message_id == STATUSTEXT
            )
        super().arrive(link, source, data)


class LossyLink:
    """The fixture's value: a call degrades legs, from now on or for a ``with`` block."""

    def __init__(self, net: LossyNet) -> None:
        self._net = net

    def __call__(
        self,
        *,
        loss: float = 0.0,
        duplication: float = 0.0,
        delay: float = 0.001,
        jitter: float = 0.0,
        leg: Leg = "client",
    ) -> ExitStack:
        """Lose and duplicate (probabilities 0–1) and delay (s) datagrams, both ways.

        ``jitter`` is the largest extra delay of a datagram, so that datagrams can overtake each
        other. Raise ValueError if a value is out of range.
        """
        if leg not in LEGS:
            raise ValueError(f"leg must be one of {', '.join(LEGS)}, not {leg!r}")
        if not (0.0 <= loss <= 1.0 and 0.0 <= duplication <= 1.0):
            raise ValueError(f"loss and duplication must be 0 to 1, not {loss} and {duplication}")
        if not (0.0 <= delay < inf and 0.0 <= jitter < inf):
            raise ValueError(f"delay and jitter must be 0 s or more, not {delay} and {jitter}")
        how = Conditions(delay=delay, jitter=jitter, loss=loss, duplication=duplication)
        end = ExitStack()
        end.callback(setattr, self._net, "ways", self._net.ways)
        self._net.ways = self._net.ways | dict.fromkeys(LEGS[leg], how)
        return end

    def mend(self) -> None:
        """Make every leg good again."""
        self._net.ways = {}
