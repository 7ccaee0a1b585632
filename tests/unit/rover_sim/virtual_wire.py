"""A wire to a simulated rover in virtual time, on which things can be made to go wrong."""

from collections import deque
from collections.abc import Callable, Iterable

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder
from mav_tasks.mavlink.messages import Message
from mav_tasks.mavlink.packet import split_datagram
from rover_sim.body import Pose
from rover_sim.check_vehicle.context import Options
from rover_sim.check_vehicle.contract import GROUPS, check_vehicle
from rover_sim.check_vehicle.report import Line, Report
from rover_sim.kinematic import KinematicBody
from rover_sim.personas import Persona
from rover_sim.vehicle import Vehicle, make_vehicle

START = 1000.0  # s
CHECKER = "checker"
ARMED = 128
POSITION_IGNORED = 0x0007

Says = Callable[[Message], Iterable[Message]]
Hears = Callable[[Message], Message | None]
Packets = Callable[[bytes], Iterable[bytes]]


class VirtualWire:
    """Implements check_vehicle's ``Wire``. A rover says, hears and sends what the hooks make of it.

    ``unsafe`` collects each setpoint that could have moved a rover that did not say it was armed.
    """

    def __init__(
        self,
        persona: Persona,
        *,
        says: Says = lambda message: [message],
        hears: Hears = lambda message: message,
        packets: Packets = lambda data: [data],
        at: Callable[["VirtualWire"], None] = lambda _: None,
    ) -> None:
        start = Pose(yaw=1.0)
        body = KinematicBody(start=start, slip=0.3, seed=None)
        self.vehicle: Vehicle = make_vehicle(body, system_id=1, persona=persona, now=START)
        self.setpoints: list[m.SetPositionTargetLocalNed] = []
        self.unsafe: list[m.SetPositionTargetLocalNed] = []
        self._shown_armed = False
        self._now = START
        self._packets = packets
        self._at = at
        self._inbox: deque[bytes] = deque()
        self._decoder = Decoder()
        autopilot = self.vehicle.autopilot
        take, handle = autopilot.take_messages, autopilot.handle

        def take_messages() -> list[Message]:
            said = [each for message in take() for each in says(message)]
            for each in said:
                if isinstance(each, m.Heartbeat):
                    self._shown_armed = bool(each.base_mode & ARMED)
            return said

        def handle_message(message: Message, sender: Address, *, now: float) -> None:
            heard = hears(message)
            if heard is not None:
                handle(heard, sender, now=now)

        autopilot.take_messages = take_messages  # type: ignore[method-assign]
        autopilot.handle = handle_message  # type: ignore[method-assign]

    def now(self) -> float:
        return self._now

    def send(self, data: bytes) -> None:
        for packet in split_datagram(data):
            message = self._decoder.decode(packet)
            if isinstance(message, m.SetPositionTargetLocalNed):
                self._watch(message)
        self.vehicle.receive(data, CHECKER, now=self._now)
        self._listen()

    def receive(self, within: float) -> bytes:
        self._at(self)
        end = self._now + within
        while not self._inbox and self._now < end:
            self._now = min(end, max(self._now, self.vehicle.next_deadline()))
            self.vehicle.handle_deadline(now=self._now)
            self._listen()
        return self._inbox.popleft() if self._inbox else b""

    def _listen(self) -> None:
        for _, data in self.vehicle.take_packets():
            self._inbox.extend(self._packets(data))

    def _watch(self, message: m.SetPositionTargetLocalNed) -> None:
        self.setpoints.append(message)
        moves = (message.vx, message.vy, message.yaw_rate) != (0.0, 0.0, 0.0)
        moves = moves or not message.type_mask & POSITION_IGNORED
        if moves and not self._shown_armed:
            self.unsafe.append(message)


def run(wire: VirtualWire, options: Options, groups: tuple[str, ...] = GROUPS) -> Report:
    """Run the contract over a wire."""
    lines: list[Line] = []
    report = check_vehicle(wire, options, system_id=None, show=lines.append, groups=groups)
    assert lines == report.lines
    assert wire.unsafe == []
    return report
