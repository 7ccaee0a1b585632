"""A net that tests can degrade per leg."""

from contextlib import ExitStack
from typing import Literal

from mav_tasks.links.memory import Conditions, MemoryNet
from mav_tasks.shell.in_memory import CLIENT_LINK, VEHICLE_LINK

#: which legs to degrade: clients to server, server to rovers, or both
Leg = Literal["client", "rover", "both"]
LEGS = {
    "client": (CLIENT_LINK,),
    "rover": (VEHICLE_LINK,),
    "both": (CLIENT_LINK, VEHICLE_LINK),
}


class LossyNet(MemoryNet):
    """A net that is good at first; ``ways`` degrades the links of one end of the server."""

    def __init__(self, *, seed: int) -> None:
        super().__init__(seed=seed)
        self.ways: dict[str, Conditions] = {}

    def conditions_between(self, source: str, target: str) -> Conditions:
        """Return the conditions between two ends, one of which is the server's."""
        return self.ways.get(source) or self.ways.get(target) or self.conditions


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
        other.
        """
        how = Conditions(delay=delay, jitter=jitter, loss=loss, duplication=duplication)
        end = ExitStack()
        end.callback(setattr, self._net, "ways", self._net.ways)
        self._net.ways = self._net.ways | dict.fromkeys(LEGS[leg], how)
        return end

    def mend(self) -> None:
        """Make every leg good again."""
        self._net.ways = {}
