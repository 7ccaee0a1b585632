"""The server's settings as parameters of its component in each vehicle's system.

They are the same for all vehicles, survive a restart, and take effect once they are durable.
Messages about the vehicle's own parameters are forwarded to it.

MAVLink guide, "Parameter Protocol". All parameters are REAL32, and what is not there is answered by
PARAM_ERROR, which clients that do not know it pass over.
"""

from collections.abc import Mapping
from functools import partial
from math import inf

from mav_tasks.basics.errors import Rejection, SettingError
from mav_tasks.config.parameter_table import PARAMETERS, as_sent, changed, with_all
from mav_tasks.config.settings import Settings
from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.commands.submissions import Submissions
from mav_tasks.engine.policy import row_of_message
from mav_tasks.engine.services import file_transfer
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, BROADCAST, Address
from mav_tasks.mavlink.enums import MavParamError, MavParamType, MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.tasks.events import ParameterSet
from mav_tasks.tasks.registry import TaskRegistry

BY_NAME = -1  # param_index of a request
HASH_CHECK = "_HASH_CHECK"  # by which a client with a cache begins: whatever it asks, it wants all
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
        self.settings, self._why_not = with_all(settings, self._kept)
        #: whether settings changed; the reader clears it
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
        before, self._configured = self.settings, settings
        self.settings, self._why_not = with_all(settings, self._kept)
        for name, each in PARAMETERS.items():
            if each.value(self.settings) != each.value(before):
                self._tell(name)
        return self.settings

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

    def receive(
        self, client: GcsClient, packet: Packet, message: ParamMessage, *, now: float
    ) -> None:
        """Answer a message that addresses the task server of one or more vehicles."""
        component, asker = message.target_component, packet.source
        for vehicle in self._vehicles.all:
            source = vehicle.server_address
            if message.target_system not in (BROADCAST, vehicle.system_id):
                continue
            is_meant = component == source.component_id
            match message:
                case _ if component == AUTOPILOT:
                    if _begins(message):
                        self._list(client, vehicle, now=now)
                        # where there is no such file, it asks for a list at once
                        client.view(vehicle.system_id).listed_at = -inf
                case _ if component != BROADCAST and not is_meant:
                    pass
                case m.ParamRequestRead() if not _begins(message):
                    name, index = message.param_id, message.param_index
                    if is_meant or name in PARAMETERS:
                        if index != BY_NAME:
                            name = dict(enumerate(PARAMETERS)).get(index, "")
                        error = _error(message, MavParamError.DOES_NOT_EXIST, to=asker)
                        answer = self._value(name) if name in PARAMETERS else error
                        client.outlet.send(answer, source)
                case m.ParamRequestList() | m.ParamRequestRead():
                    self._list(client, vehicle, now=now)
                case m.ParamSet() if is_meant or message.param_id in PARAMETERS:
                    self._set(client, asker, message, source, now=now)

    def _value(self, name: str) -> m.ParamValue:
        """Return the message that tells a parameter's value."""
        names, value = list(PARAMETERS), PARAMETERS[name].value(self.settings)
        index = names.index(name)
        return m.ParamValue(name.encode(), value, MavParamType.REAL32, len(names), index)

    def _list(self, client: GcsClient, vehicle: Vehicle, *, now: float) -> None:
        view = client.view(vehicle.system_id)
        if now - view.listed_at >= LIST_EACH:
            view.listed_at = now
            for name in PARAMETERS:
                client.outlet.send(self._value(name), vehicle.server_address)

    def _set(
        self,
        client: GcsClient,
        asker: Address,
        message: m.ParamSet,
        source: Address,
        *,
        now: float,
    ) -> None:
        """Check a PARAM_SET and record it; it takes effect, and is announced, once durable."""
        name, value, who = message.param_id, as_sent(message.param_value), str(client.who)

        def refuse(text: str, why: int, *, now: float) -> None:
            client.outlet.send(_error(message, why, to=asker), source)
            if name in PARAMETERS:  # for clients that do not know PARAM_ERROR
                client.outlet.send(self._value(name), source)
            client.tell(text, MavSeverity.WARNING, source, now=now)

        def settle(words: str, why: int, *, now: float) -> None:
            """Take it, or refuse it for ``words`` and record the value in force again.

            That only if no later one is on its way.
            """
            if self._pending.get(name) is message:
                del self._pending[name]
                if words:
                    self._registry.record(ParameterSet(name, self._kept.get(name), who, now))
            if words:
                refuse(words, why, now=now)
            else:
                self._take(name, value)

        def accept(*, now: float) -> None:
            words = ""
            try:
                changed(self.settings, name, value)
            except SettingError as error:  # the values that it was checked against were not stored
                words = str(error)
            settle(words, MavParamError.VALUE_OUT_OF_RANGE, now=now)

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
        words = f"{name} was not stored in time: not set"
        give_up = partial(settle, words, MavParamError.PERMISSION_DENIED)
        self._submissions.gate.hold(accept, give_up, now=now)

    def _take(self, name: str, value: float) -> None:
        self._kept[name] = value
        self.settings, self._why_not = with_all(self._configured, self._kept)
        self.is_changed = True
        self._tell(name)

    def _tell(self, name: str) -> None:
        """Send a parameter's value to every client."""
        told = self._value(name)
        for vehicle in self._vehicles.all:
            for client in self._gcs.clients:
                if client.is_heard and vehicle.system_id in client.introduced:
                    client.outlet.send(told, vehicle.server_address)


def _error(message: m.ParamRequestRead | m.ParamSet, why: int, *, to: Address) -> m.ParamError:
    """Return the PARAM_ERROR that answers a message; ``why`` is a MAV_PARAM_ERROR."""
    index = message.param_index if isinstance(message, m.ParamRequestRead) else BY_NAME
    return m.ParamError(*to, message.param_id.encode()[:16], index, why)


def _begins(message: ParamMessage) -> bool:
    """Whether a client begins with the hash of all, or with the file; it may then skip the list."""
    if isinstance(message, m.FileTransferProtocol):
        return file_transfer.opens_parameters(message)
    return isinstance(message, m.ParamRequestRead) and message.param_id == HASH_CHECK
