"""The station on a memory net, as a party of a virtual world."""

from mav_tasks.links.memory import MemoryNet
from mav_tasks.shell.in_memory import CLIENT_LINK
from tests.kit.qgc.client import Qgc
from tests.kit.qgc.guided import Operator
from tests.kit.qgc.plan_master import PlanMaster
from tests.kit.qgc.profile import Profile
from tests.kit.qgc.session import Session


class QgcParty:
    """One station with its own endpoint."""

    def __init__(
        self,
        net: MemoryNet,
        name: str,
        profile: Profile,
        *,
        server: str = CLIENT_LINK,
        dials: bool = True,
    ) -> None:
        self.name = name
        self.qgc = Qgc(profile, now=net.now, dials=dials)
        self._net = net
        self._link = net.link(name)
        self._server = server
        self._flush()

    @property
    def vehicle(self) -> Session:
        """The only vehicle, brought up to the present time."""
        self.qgc.handle_deadline(now=self._net.now)
        (session,) = self.qgc.vehicles.values()
        return session

    @property
    def operator(self) -> Operator:
        """The buttons for the only vehicle; their messages leave with the next step of time."""
        return self.vehicle.operator

    @property
    def plans(self) -> PlanMaster:
        """The plan view."""
        return self.vehicle.plans

    @property
    def popups(self) -> list[str]:
        """The texts of all popups so far."""
        return [each.text for each in self.qgc.screen.popups]

    @property
    def is_connected(self) -> bool:
        """Whether the initial connection is complete."""
        return bool(self.qgc.vehicles) and self.vehicle.connecting.is_complete

    def check(self) -> None:
        """Raise AssertionError for complaints, false losses and bad bytes."""
        complaints = self.qgc.screen.complaints
        assert not complaints, f"{self.name}: {complaints}"
        assert not self.qgc.lost, f"{self.name}: seems to have lost {self.qgc.lost}"
        assert self.qgc.wire.bad == 0, f"{self.name}: {self.qgc.wire.bad} times no packet"

    def next_deadline(self) -> float | None:
        """Return when ``turn`` is due, unless something arrives before."""
        return self._net.now if self.qgc.has_packets else self.qgc.next_deadline()

    def turn(self, *, now: float) -> None:
        """Read what arrived, do what is due, send the results."""
        for _, data in self._link.receive(len(self._link.arrived)):
            self.qgc.receive(data, now=now)
        self.qgc.handle_deadline(now=now)
        self._flush()

    def _flush(self) -> None:
        for data in self.qgc.take_packets():
            self._link.send(self._server, data)
