"""Who else is about a rover: a task server, a ground station, somebody who sends setpoints."""

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavComponent, MavResult, MavType
from mav_tasks.mavlink.packet import Packet
from mav_tasks.tasks.lifecycle import TaskReason

MOST = 32  # of each kind that are remembered
SETPOINTS = frozenset(
    {m.SetPositionTargetLocalNed.id, m.SetPositionTargetGlobalInt.id, m.SetAttitudeTarget.id}
)


class OtherTraffic:
    """What was heard that is neither ours nor the rover's autopilot."""

    def __init__(self, ours: Address) -> None:
        self._ours = ours
        #: of the rover that is meant; what is in other systems is no matter here
        self.system_id: int | None = None
        #: on-board computers inside a rover's system: a task server shows itself as one
        self.computers: dict[Address, None] = {}
        #: those that have answered as a task server
        self.servers: dict[Address, None] = {}
        self.stations: dict[Address, None] = {}
        self.setpoints: dict[Address, None] = {}
        self.commanding: dict[Address, None] = {}

    def __repr__(self) -> str:
        return f"OtherTraffic({self.in_words()})"

    def receive(self, packet: Packet, message: m.Message) -> None:
        source = packet.source
        if packet.message_id in SETPOINTS:
            _note(self.setpoints, source)
        elif source == self._ours:  # whoever has our address does what we do
            _note(self.servers, source)
        elif isinstance(message, m.Heartbeat) and source.component_id != AUTOPILOT:
            if message.type == MavType.GCS:
                _note(self.stations, source)
            elif message.type == MavType.ONBOARD_CONTROLLER:
                _note(self.computers, source)
        elif isinstance(message, m.TaskQueueStatus | m.TaskStatus):
            _note(self.servers, source)
        elif isinstance(message, m.CommandAck) and source.system_id == self.system_id:
            asker = Address(message.target_system, message.target_component)
            if _denies_our_address(message):
                _note(self.servers, source)
            elif not asker.reaches(self._ours):
                _note(self.commanding, asker)

    @property
    def own_computers(self) -> list[Address]:
        """The on-board computers inside the rover's system."""
        return [each for each in self.computers if each.system_id == self.system_id]

    def why_leave(self) -> str:
        """Return in words why nothing at all may be asked here, "" if it may."""
        if self._ours in self.servers:
            return f"task server {self._ours} is on this link: end it first"
        if self.servers:
            return f"task server {_listed(self.servers)} is on this link: probe on a direct link"
        if self.setpoints:
            return f"{_listed(self.setpoints)} sends setpoints: the rover is being driven"
        stations = [each for each in self.stations if _is_server_like(each)]
        if stations:
            return f"task server {_listed(stations)} is on this link: end it first"
        return ""

    def why_not_drive(self) -> str:
        """Return in words why the rover may not be driven, "" if it may."""
        if self.why_leave():
            return self.why_leave()
        if self.commanding:
            return f"{_listed(self.commanding)} also commands the rover"
        if self.own_computers:
            return (
                f"on-board computer {_listed(self.own_computers)} may drive the rover: end it first"
            )
        return ""

    def in_words(self) -> list[str]:
        return [
            *(f"ground station {each}" for each in self.stations),
            *(f"on-board computer {each}" for each in self.own_computers),
            *(f"{each} commands it" for each in self.commanding),
            *(f"{each} sends setpoints" for each in self.setpoints),
        ]


def _denies_our_address(ack: m.CommandAck) -> bool:
    """We speak as a task server does: another one heeds nobody who does."""
    return (ack.result, ack.result_param2) == (MavResult.DENIED, TaskReason.NOT_ALLOWED)


def _is_server_like(address: Address) -> bool:
    """A ground station of a person is no on-board computer; a task server on this side is both."""
    return MavComponent.ONBOARD_COMPUTER <= address.component_id <= MavComponent.ONBOARD_COMPUTER4


def _note(to: dict[Address, None], address: Address) -> None:
    if len(to) < MOST:
        to[address] = None


def _listed(addresses: "dict[Address, None] | list[Address]") -> str:
    return ", ".join(str(each) for each in addresses)
