"""A station and a stub vehicle, in virtual time."""

from typing import Any

from mav_tasks.in_memory import CLIENT_LINK
from mav_tasks.links.memory import MemoryNet
from rover_sim.virtual import VirtualWorld
from tests.kit.qgc.party import QgcParty
from tests.kit.qgc.profile import V4, Profile
from tests.kit.qgc.stub import APM_AUTOPILOT, APM_SET, Stub


class Pair(VirtualWorld):
    """A world with a station and a stub."""

    def __init__(self, profile: Profile = V4, **how: Any) -> None:
        super().__init__(MemoryNet())
        if how.get("autopilot") == APM_AUTOPILOT:
            how = {"parameters": dict(APM_SET), "mode": 4} | how
        self.stub = Stub(self.net, CLIENT_LINK, **how)
        self.party = QgcParty(self.net, "qgc", profile)
        self.join(self.stub, self.party)

    def connected(self, within: float = 5.0) -> "Pair":
        assert self.run_until(lambda: self.party.is_connected, within=within)
        return self

    def driving(self) -> "Pair":
        self.connected()
        self.stub.armed, self.stub.landed_state = True, 2
        self.run(1.1)
        return self

    @property
    def popups(self) -> list[str]:
        return self.party.popups

    def popup_at(self, text: str) -> float:
        found = [s.at for s in self.party.qgc.screen.popups if s.text.startswith(text)]
        assert len(found) == 1, self.popups
        return found[0]
