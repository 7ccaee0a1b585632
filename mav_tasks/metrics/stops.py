"""How fast a STOP acts: until the zero setpoint is at the link, and until the rover stands."""

from collections.abc import Callable, Sequence
from math import inf

from mav_tasks.basics.histogram import Histogram
from mav_tasks.engine.figures import Figures
from mav_tasks.engine.inputs import Outgoing
from mav_tasks.mavlink.messages import SetPositionTargetLocalNed
from mav_tasks.mavlink.packet import split_datagram
from mav_tasks.tasks.events import Event, VehicleHalted
from mav_tasks.tasks.lifecycle import TaskReason

LATENCIES = (2e-4, 5e-4, 1e-3, 2e-3, 3e-3, 5e-3, 0.01, 0.02, 0.05, 0.1, 0.3, 1.0)  # s
STANDSTILLS = (0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.5, 10.0, 20.0)  # s
LOOK = 0.05  # s between two looks at a rover that is stopping
GIVES_UP = 30.0  # s after which a rover that does not stand counts no more
TARGET_SYSTEM = 50  # offset in the payload of SET_POSITION_TARGET_LOCAL_NED


class Stops:
    """Measures each STOP that sends a setpoint. Times are of the server's clock."""

    def __init__(
        self, figures: Figures, *, clock: Callable[[], float], woke_at: Callable[[], float]
    ) -> None:
        self._figures = figures
        self._clock = clock
        self._woke_at = woke_at
        self._stopping: dict[int, float] = {}  # by vehicle: when its STOP was read
        self.latency = Histogram(LATENCIES)
        self.standstill = Histogram(STANDSTILLS)
        #: s, the most that the packets of this turn had waited before, after a stall
        self.waited = 0.0
        #: when ``look`` must be called
        self.look_at = inf

    def __repr__(self) -> str:
        return f"Stops({self.latency!r}, {list(self._stopping)} stopping)"

    def note(self, packets: Sequence[Outgoing], events: Sequence[Event], *, now: float) -> None:
        """Note the STOPs among a turn's events; its packets were just given to the links."""
        waited, self.waited = self.waited, 0.0
        stopped = [
            event.vehicle
            for event in events
            if isinstance(event, VehicleHalted) and event.reason is TaskReason.STOPPED
        ]
        if not stopped:
            return
        read_at = self._woke_at() - waited
        took = max(0.0, self._clock() - read_at)
        told = _told(packets)
        for vehicle in stopped:
            if vehicle in told:
                self.latency.note(took)
                if not self._figures.is_still(vehicle, now=now):
                    self._stopping.setdefault(vehicle, read_at)
                    self.look_at = now + LOOK

    def look(self, *, now: float) -> None:
        """Note the rovers that stand by now."""
        for vehicle, since in list(self._stopping.items()):
            if self._figures.is_still(vehicle, now=now):
                self.standstill.note(now - since)
                del self._stopping[vehicle]
            elif now - since > GIVES_UP:
                del self._stopping[vehicle]
        self.look_at = now + LOOK if self._stopping else inf

    def resumed(self, vehicle: int) -> None:
        """Note that a vehicle may move again."""
        self._stopping.pop(vehicle, None)


def _told(packets: Sequence[Outgoing]) -> set[int]:
    """Return the system ids to which a setpoint is among the packets."""
    return {
        packet.payload[TARGET_SYSTEM]
        for outgoing in packets
        for packet in split_datagram(outgoing.data)
        if packet.message_id == SetPositionTargetLocalNed.id and len(packet.payload) > TARGET_SYSTEM
    }
