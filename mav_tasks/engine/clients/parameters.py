"""The server's settings as parameters of its component in each vehicle's system.

They are the same for all vehicles, survive a restart, and take effect once they are durable.
Messages about the vehicle's own parameters are forwarded to it.
"""

from collections.abc import Mapping

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.commands.submissions import Submissions
from mav_tasks.engine.policy import row_of_message
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.errors import Rejection, SettingError
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, BROADCAST
from mav_tasks.mavlink.enums import MavParamError, MavParamType, MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services import file_transfer, param_receiver
from mav_tasks.services.param_receiver import HASH_CHECK
from mav_tasks.services.parameter_table import PARAMETERS, as_sent, changed, with_all
from mav_tasks.settings import Settings
from mav_tasks.tasks.events import ParameterSet
from mav_tasks.tasks.registry import TaskRegistry

LIST_EACH = 0.2  # s between lists: one packet asks for many, no client asks again so soon
ParamMessage = m.ParamRequestList | m.ParamRequestRead | m.ParamSet | m.FileTransferProtocol


class ParameterServer:
    """The server of the parameter protocol, and the settings that follow from it."""

    def __init__(
        self,
        gcs: GcsSide,
        vehicles: VehicleSide,
        registry: TaskRegistry,
        submissions: Submissions,
        *,
        settings: Settings,
        kept: Mapping[str, float],
    ) -> None:
        self._gcs = gcs
        self._vehicles = vehicles
        self._registry = registry
        self._submissions = submissions
        self._configured = settings
        self._kept = dict(kept)
        #: by name, the latest PARAM_SET that is not durable yet
        self._pending: dict[str, m.ParamSet] = {}
        self._settings, self._why_not = with_all(settings, self._kept)
        #: whether settings changed since the last ``take_change``
        self.is_changed = False

    @property
    def in_force(self) -> dict[str, float]:
        """Parameters set by clients, by name, that the configuration does not rule out."""
        return {name: value for name, value in self._kept.items() if name not in self._why_not}

    @property
    def not_in_force(self) -> tuple[str, ...]:
        """Reasons why the other parameters are ruled out."""
        return tuple(why for _, why in sorted(self._why_not.items()))

    def configured(self, settings: Settings) -> Settings:
        """Take reloaded settings, and return them with the parameters applied."""
        before = self._values()
        self._configured = settings
        self._settings, self._why_not = with_all(settings, self._kept)
        for name, value in self._values().items():
            if value != before[name]:
                self._tell(name)
        return self._settings

    def share(self, values: Mapping[str, float]) -> None:
        """Take the parameters that clients have set at all gateways; they are durable.

        One that is set here, and not durable yet, keeps its value until then.
        """
        ours = {name: self._kept[name] for name in self._pending if name in self._kept}
        kept = {name: value for name, value in values.items() if name not in self._pending} | ours
        if kept == self._kept:
            return
        self._kept = kept
        self.configured(self._configured)
        self.is_changed = True

    def take_change(self) -> Settings:
        """Return the settings in force, and clear ``is_changed``."""
        self.is_changed = False
        return self._settings

    def receive(
        self, client: GcsClient, packet: Packet, message: ParamMessage, *, now: float
    ) -> None:
        """Answer a message that addresses the task server of one or more vehicles."""
        vehicles = [
            v for v in self._vehicles.all if message.target_system in (BROADCAST, v.system_id)
        ]
        for vehicle in vehicles:
            component = message.target_component
            if component in (BROADCAST, vehicle.server_component):
                self._answer(client, vehicle, packet, message, now=now)
            elif component == AUTOPILOT and _begins(message):
                self._list(client, vehicle, now=now)
                client.listed_at.clear()  # where there is no such file, it asks for a list at once

    def _answer(
        self,
        client: GcsClient,
        vehicle: Vehicle,
        packet: Packet,
        message: ParamMessage,
        *,
        now: float,
    ) -> None:
        is_meant = message.target_component != BROADCAST
        match message:
            case m.ParamRequestList():
                self._list(client, vehicle, now=now)
            case m.ParamRequestRead() if _begins(message):
                self._list(client, vehicle, now=now)
            case m.ParamRequestRead() if is_meant or message.param_id in PARAMETERS:
                answer = param_receiver.read(self._values(), message, to=packet.source)
                client.outlet.send(answer, vehicle.server_address)
            case m.ParamSet() if is_meant or message.param_id in PARAMETERS:
                self._set(client, vehicle, packet, message, now=now)

    def _values(self) -> dict[str, float]:
        return {name: each.value(self._settings) for name, each in PARAMETERS.items()}

    def _list(self, client: GcsClient, vehicle: Vehicle, *, now: float) -> None:
        listed_at = client.listed_at.get(vehicle.system_id)
        if listed_at is not None and now - listed_at < LIST_EACH:
            return
        client.listed_at[vehicle.system_id] = now
        for value in param_receiver.all_values(self._values()):
            client.outlet.send(value, vehicle.server_address)

    def _set(
        self,
        client: GcsClient,
        vehicle: Vehicle,
        packet: Packet,
        message: m.ParamSet,
        *,
        now: float,
    ) -> None:
        """Check a PARAM_SET and record it; it takes effect, and is announced, once durable."""
        name, value, who = message.param_id, as_sent(message.param_value), str(client.who)
        asker = packet.source

        def refuse(text: str, why: int, *, now: float) -> None:
            source = vehicle.server_address
            client.outlet.send(param_receiver.error(message, why, to=asker), source)
            if name in PARAMETERS:  # for clients that do not know PARAM_ERROR
                client.outlet.send(param_receiver.value_of(self._values(), name), source)
            client.tell(text, MavSeverity.WARNING, source, now=now)

        def settle(*, was_stored: bool, now: float) -> None:
            """Forget it, and record the value in force unless a later one is on its way."""
            if self._pending.get(name) is message:
                del self._pending[name]
                if not was_stored:
                    self._registry.record(ParameterSet(name, self._kept.get(name), who, now))

        def accept(*, now: float) -> None:
            try:
                changed(self._settings, name, value)
            except SettingError as error:  # the values that it was checked against were not stored
                settle(was_stored=False, now=now)
                refuse(str(error), MavParamError.VALUE_OUT_OF_RANGE, now=now)
            else:
                settle(was_stored=True, now=now)
                self._take(name, value)

        def give_up(*, now: float) -> None:
            settle(was_stored=False, now=now)
            words = f"{name} was not stored in time: not set"
            refuse(words, MavParamError.PERMISSION_DENIED, now=now)

        if name not in PARAMETERS:
            refuse(f"{name}: no such parameter", MavParamError.DOES_NOT_EXIST, now=now)
            return
        try:
            if message.param_type != MavParamType.REAL32:
                raise SettingError(f"{name} must be sent as REAL32")
            pending = {each: as_sent(set_.param_value) for each, set_ in self._pending.items()}
            expected, _ = with_all(self._configured, self._kept | pending)
            changed(expected, name, value)
            client.rights.require(row_of_message(m.ParamSet.id).role, "set parameters")
            self._submissions.check_open()
        except SettingError as error:
            refuse(str(error), MavParamError.VALUE_OUT_OF_RANGE, now=now)
            return
        except Rejection as refusal:
            refuse(refusal.text, MavParamError.PERMISSION_DENIED, now=now)
            return
        if name in self._pending or value != self._kept.get(name):
            self._registry.record(ParameterSet(name, value, who, now))
        self._pending[name] = message
        self._submissions.gate.hold(accept, give_up, now=now)

    def _take(self, name: str, value: float) -> None:
        self._kept[name] = value
        self._settings, self._why_not = with_all(self._configured, self._kept)
        self.is_changed = True
        self._tell(name)

    def _tell(self, name: str) -> None:
        """Send a parameter's value to every client."""
        told = param_receiver.value_of(self._values(), name)
        for vehicle in self._vehicles.all:
            for client in self._gcs.clients:
                if client.is_heard and vehicle.system_id in client.introduced:
                    client.outlet.send(told, vehicle.server_address)


def _begins(message: ParamMessage) -> bool:
    """Whether a client begins with the hash of all, or with the file; it may then skip the list."""
    if isinstance(message, m.FileTransferProtocol):
        return file_transfer.opens_parameters(message)
    return isinstance(message, m.ParamRequestRead) and message.param_id == HASH_CHECK
