"""The client's protocol, sans-I/O: packets and time in, packets out.

A Session sends heartbeats, finds the task server of each rover, keeps the latest statuses, and
repeats each request until it is answered or times out. ``aio`` builds the API for scripts on it.
"""

import struct
from collections.abc import Callable, Container
from dataclasses import dataclass
from math import inf

from mav_tasks.client.calls import AGAIN, Call, Calls
from mav_tasks.client.fleet_view import KEPT, FleetView
from mav_tasks.client.transfers import MESSAGES as TRANSFER_MESSAGES
from mav_tasks.client.transfers import Transfers
from mav_tasks.client.values import (
    REFUSES,
    TaskStatus,
    TaskTiming,
    Text,
    VehicleStatus,
    heartbeat_age_of,
    member_of,
    shares_id,
    task_status_of,
    task_timing_of,
)
from mav_tasks.client.watch import Followed, Watch
from mav_tasks.client.wire import SERVER
from mav_tasks.engine.services import statustext
from mav_tasks.engine.services.statustext import TextReceiver
from mav_tasks.engine.services.vehicle_status import HeartbeatSender, component_heartbeat
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, BROADCAST, Address
from mav_tasks.mavlink.codec import Decoder, Encoder, Packer, target_of
from mav_tasks.mavlink.enums import MavCmd, MavResult, MavState
from mav_tasks.mavlink.float_param import to_param
from mav_tasks.mavlink.packet import Packet
from mav_tasks.tasks.lifecycle import TaskReason, words_of

#: s within which the STATUSTEXT of a refusal follows its ack
WORDS_WITHIN = 0.25
#: Hz of telemetry; a client's share of a busy link is small
TELEMETRY_RATE = 1
ALL, POSITION, ATTITUDE = 0, 6, 10  # MAV_DATA_STREAM
FOLLOWED_AGAIN = 3.0  # s for which a request about a followed task is repeated

DECODED = frozenset(
    kind.id
    for kind in (
        m.Heartbeat,
        m.CommandAck,
        m.ParamValue,
        m.Statustext,
        m.TaskStatus,
        m.TaskQueueStatus,
        m.TaskTiming,
        *TRANSFER_MESSAGES,
    )
)


@dataclass(frozen=True, slots=True)
class Reply:
    """The answer to a command; ``words`` is the reason of a refusal."""

    result: int
    value: int
    words: str = ""

    @property
    def is_accepted(self) -> bool:
        return self.result == MavResult.ACCEPTED


Done = Callable[[Reply | None], None]
#: the messages that answer requests; ``on_answer`` gets each with its vehicle
Answer = TaskStatus | TaskTiming | m.TaskQueueStatus | m.ParamValue


@dataclass(slots=True)
class _Refused:
    vehicle: int
    ack: m.CommandAck
    done: Done
    until: float


class Session:
    """The protocol state of one client.

    The asyncio layer sets the ``on_`` callbacks to receive news.
    """

    def __init__(
        self, address: Address, *, now: float, telemetry_rate: int = TELEMETRY_RATE
    ) -> None:
        self.address = address
        self._telemetry_rate = telemetry_rate  # Hz
        self.fleet = FleetView()
        self.watch = Watch()
        self._encoder = Encoder(address)
        self._decoder = Decoder()
        self._heartbeat = HeartbeatSender(now=now)
        self.calls = Calls()
        self._texts = TextReceiver()
        self._transfers: dict[Address, Transfers] = {}
        self._refused: list[_Refused] = []
        self._out: list[bytes] = []
        self._listing: Call | None = None  # the unanswered request for the list of rovers
        self.on_served: Callable[[], None] = lambda: None
        self.on_news: Callable[[Followed], None] = lambda _followed: None
        self.on_answer: Callable[[Answer, int], None] = lambda _answer, _vehicle: None
        self.on_text: Callable[[Text], None] = lambda _text: None
        self.on_vehicle: Callable[[int], None] = lambda _vehicle: None

    def __repr__(self) -> str:
        return f"Session({self.address}, {self.fleet!r}, {self.calls!r})"

    # time and packets

    def receive(self, packet: Packet, *, now: float) -> None:
        """Process one packet."""
        if packet.message_id in KEPT and self.fleet.telemetry(packet, now=now):
            self.on_vehicle(packet.system_id)
        if packet.message_id not in DECODED:
            return
        message = self._decoder.decode(packet)
        if message is None or not target_of(message).reaches(self.address):
            return
        match message:
            case m.Heartbeat():
                self._heard(packet, message, now=now)
            case m.CommandAck():
                self.calls.receive(message, vehicle=packet.system_id, now=now)
            case m.TaskStatus():
                self._task_status(task_status_of(message, packet.system_id), now=now)
            case m.TaskQueueStatus():
                self.fleet.served_by(packet.source, heartbeat_age_of(message), now=now)
                self.fleet.shared[packet.system_id] = shares_id(message)
                self.on_served()
                self.on_vehicle(packet.system_id)
                self.on_answer(message, packet.system_id)
            case m.ParamValue() if packet.component_id != AUTOPILOT:
                self.on_answer(message, packet.system_id)
            case m.TaskTiming():
                self.on_answer(task_timing_of(message, packet.system_id), packet.system_id)
            case m.Statustext():
                for text in self._texts.receive(packet.source, message, now=now):
                    self._text(text)
            case _:
                transfers = self._transfers.get(packet.source)
                if transfers is not None:
                    transfers.receive(message, now=now)

    def next_deadline(self) -> float:
        """Return when to call ``handle_deadline``."""
        due = [
            self._texts.next_deadline(),
            self._heartbeat.next_deadline(),
            *(refused.until for refused in self._refused),
        ]
        maybe = [self.calls.next_deadline(), self.fleet.next_deadline()]
        maybe += [self.watch.next_deadline()]
        maybe += [transfers.next_deadline() for transfers in self._transfers.values()]
        due += [at for at in maybe if at is not None]
        return min(due)

    def handle_deadline(self, *, now: float) -> None:
        """Send and repeat what is due, and end timed-out requests."""
        if self._heartbeat.is_due(now=now):
            self.greet()
        for vehicle in self.fleet.to_ask(now=now):
            request = request_message(vehicle, m.TaskQueueStatus.id)
            self.call(Call(request, AGAIN), lambda _reply: None, now=now)
        for followed in self.watch.to_ask(now=now):
            self.ask_about(followed, now=now)
        for text in self._texts.handle_deadline(now=now):
            self._text(text)
        self.calls.handle_deadline(now=now)
        for transfers in self._transfers.values():
            transfers.handle_deadline(now=now)
        for refused in [each for each in self._refused if now >= each.until]:
            self._refused.remove(refused)
            refused.done(_reply(refused.ack, ""))

    def take_packets(self) -> list[bytes]:
        """Return the packets to send since the last call, in order."""
        for command in self.calls.take():
            self.send(command)
        for transfers in self._transfers.values():
            for message in transfers.take():
                self.send(message)
        out, self._out = self._out, []
        return out

    # requests of the asyncio layer

    def greet(self) -> None:
        """Send a heartbeat. It is not a ground station's: losing one could stop the rover."""
        self.send(component_heartbeat(MavState.ACTIVE))

    def ask_for_rovers(self, *, now: float) -> None:
        """Request the list of rovers until it is answered: a silent rover sends no heartbeat."""

        def done(_reply: Reply | None) -> None:
            self._listing = None
            self.fleet.is_listed = True
            self.on_served()

        if self._listing is not None:  # the link came up only now
            self.calls.settle(self._listing, is_answered=True, now=now)
        request = request_message(BROADCAST, m.TaskQueueStatus.id)
        self._listing = Call(request, give_up_after=inf)
        self.call(self._listing, done, now=now)

    def send(self, message: m.Message) -> None:
        """Send a message now."""
        self._out.append(self._encoder.encode(message))

    def check(self, message: m.Message) -> None:
        """Raise ValueError if a number does not fit its field, before it breaks a whole send."""
        try:
            Packer().pack(message, self.address, seq=0)
        except (OverflowError, struct.error) as error:
            words = f"a number of {type(message).__name__} is too large to be sent: {error}"
            raise ValueError(words) from None

    def call(self, call: Call, done: Done, *, now: float) -> None:
        """Send a command until it is answered. Call ``done`` once, with None after a time-out.

        Raise ValueError if a number does not fit its field.
        """
        self.check(call.message)
        vehicle = call.message.target_system

        def ended(ack: m.CommandAck | None, *, now: float) -> None:
            if ack is None:
                done(None)
            elif ack.result == MavResult.ACCEPTED or not ack.result_param2:
                done(_reply(ack, ""))
            else:
                self._refused.append(_Refused(vehicle, ack, done, now + WORDS_WITHIN))

        call.done = ended
        self.calls.begin(call, now=now)

    def transfers(self, target: Address) -> Transfers:
        """Return the uploads and downloads of a component."""
        return self._transfers.setdefault(target, Transfers(target))

    def vehicles(
        self, *, only: Container[int] | None = None, now: float
    ) -> tuple[VehicleStatus, ...]:
        """Return the rovers whose task server has answered, by id; ``only``: these of them."""
        served = (each for each in self.fleet.served() if only is None or each in only)
        views = (self.fleet.get(system_id) for system_id in served)
        return tuple(v.status(self._decoder, now=now) for v in views if v is not None)

    def follow(self, task_id: int, vehicle: int, *, nonce: int | None, now: float) -> Followed:
        """Follow a task.

        A followed task with its id and another nonce is lost: the server restarted its task ids.
        """
        before = self.watch.get(task_id)
        if before is not None and nonce is not None and before.nonce not in (None, nonce):
            self.watch.lose(before)
            self.on_news(before)
        return self.watch.follow(task_id, vehicle, nonce=nonce, now=now)

    def ask_about(self, followed: Followed, *, now: float) -> None:
        """Request the status of a followed task. Its answer arrives as news."""
        vehicle = followed.vehicle
        followed.is_asked = True

        def done(reply: Reply | None) -> None:
            followed.is_asked = False
            if reply is None or reply.is_accepted or followed.is_over:
                return
            if reply.value == TaskReason.NOT_FOUND:
                self.watch.lose(followed)
                self.on_news(followed)

        request = request_message(vehicle, m.TaskStatus.id, to_param(followed.id))
        self.call(Call(request, FOLLOWED_AGAIN), done, now=now)
        interval = self.watch.stream_of(vehicle)
        if interval is not None and followed.status is not None and followed.status.is_active:
            self.set_stream(vehicle, interval, now=now)

    def set_stream(self, vehicle: int, interval: float | None, *, now: float) -> None:
        """Request the active task's status each ``interval`` seconds; None: only at changes."""
        us = -1.0 if interval is None else interval * 1e6
        command = m.CommandLong(
            vehicle, AUTOPILOT, MavCmd.SET_MESSAGE_INTERVAL, 0, m.TaskStatus.id, us, 0, 0, 0, 0, 0
        )
        self.call(Call(command, FOLLOWED_AGAIN), lambda _reply: None, now=now)

    def _request_telemetry(self, vehicle: int) -> None:
        """Request all streams at the usual rate, and position and attitude at ours."""
        self.send(m.RequestDataStream(vehicle, AUTOPILOT, ALL, TELEMETRY_RATE, 1))
        if self._telemetry_rate != TELEMETRY_RATE:
            for stream in (POSITION, ATTITUDE):
                rate = self._telemetry_rate
                self.send(m.RequestDataStream(vehicle, AUTOPILOT, stream, rate, 1))

    # received messages

    def _heard(self, packet: Packet, message: m.Heartbeat, *, now: float) -> None:
        vehicle = packet.system_id
        is_new = self.fleet.heartbeat(packet, message, now=now)
        self.on_vehicle(vehicle)
        if not is_new:
            return
        self._request_telemetry(vehicle)
        self.watch.hurry(vehicle, now=now)
        interval = self.watch.stream_of(vehicle)
        if interval is not None:
            self.set_stream(vehicle, interval, now=now)

    def _task_status(self, status: TaskStatus, *, now: float) -> None:
        followed = self.watch.receive(status, now=now)
        self.on_answer(status, status.vehicle)
        if followed is not None:
            self.on_news(followed)

    def _text(self, text: statustext.Text) -> None:
        vehicle, component = text.sender
        view = self.fleet.get(vehicle)
        is_ours = view is not None and view.server_component in (None, component)
        is_ours |= text.sender == SERVER
        if is_ours and text.severity in REFUSES:
            for refused in self._refused:
                if refused.vehicle in (0, vehicle):
                    self._refused.remove(refused)
                    refused.done(_reply(refused.ack, text.words))
                    break
        self.on_text(Text(vehicle, component, text.severity, text.words))


def request_message(vehicle: int, message_id: int, *params: float) -> m.CommandLong:
    """Return the REQUEST_MESSAGE command for a message of a vehicle's task server.

    SERVER's system id instead of a vehicle's: a task of any vehicle.
    """
    filled = (*params, *(0.0,) * (6 - len(params)))
    component = SERVER.component_id if vehicle == SERVER.system_id else AUTOPILOT
    return m.CommandLong(vehicle, component, MavCmd.REQUEST_MESSAGE, 0, float(message_id), *filled)


def _reply(ack: m.CommandAck, words: str) -> Reply:
    if ack.result != MavResult.ACCEPTED and not words:
        reason = member_of(ack.result_param2, TaskReason.NONE)
        words = words_of(reason) if reason else f"result {ack.result}"
    return Reply(ack.result, ack.result_param2, words)
