"""One end of a talk with one rover: what it says, what it was asked, what is to be sent. Pure."""

from collections import Counter

from mav_tasks.config.settings import Watch
from mav_tasks.engine.services.commands import CommandSender
from mav_tasks.engine.services.offboard import OffboardControl, is_request_of
from mav_tasks.engine.services.persona import Persona
from mav_tasks.engine.services.statustext import TextReceiver
from mav_tasks.engine.services.vehicle_status import (
    HeartbeatMonitor,
    HeartbeatSender,
    gcs_heartbeat,
)
from mav_tasks.engine.vehicles.motion_monitor import MotionMonitor
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.enums import MavCmd, MavResult, MavType
from mav_tasks.mavlink.packet import Packet
from mav_tasks.probe.other_traffic import SETPOINTS, OtherTraffic
from mav_tasks.probe.steps import Steps, Wait

NO_ANSWER = "no answer"
GIVE_UP = 1.0  # s, of a command that is not answered
MOST_TEXTS = 200
NOT_VEHICLES = frozenset({MavType.GCS, MavType.ONBOARD_CONTROLLER})
USED = SETPOINTS | {
    kind.id
    for kind in (
        m.Heartbeat,
        m.Attitude,
        m.LocalPositionNed,
        m.AutopilotVersion,
        m.CommandAck,
        m.MessageInterval,
        m.MissionCount,
        m.MissionAck,
        m.ParamValue,
        m.Statustext,
        m.SysStatus,
        m.TaskQueueStatus,
        m.TaskStatus,
    )
}


class Conversation:
    """Packets and time in, packets out; the steps of the probe look at it and ask through it."""

    def __init__(self, source: Address, *, system_id: int | None, watch: Watch, now: float) -> None:
        """``system_id``: of the rover that is meant; None: the first that is heard."""
        self.now = now
        self.source = source
        self.watch = watch
        self.others = OtherTraffic(source)
        self.sender = CommandSender(source)
        self.motion = MotionMonitor(watch)
        self.control: OffboardControl | None = None
        self.persona: Persona | None = None
        self.rover: Address | None = None
        self.monitor: HeartbeatMonitor | None = None
        #: of the autopilot, by id
        self.latest: dict[int, m.Message] = {}
        self.counts: Counter[int] = Counter()
        self.parameters: dict[str, m.ParamValue] = {}
        self.intervals: dict[int, int] = {}  # µs, by message id, as MESSAGE_INTERVAL has them
        self.texts: list[str] = []
        self._wanted_id = system_id
        self._decoder = Decoder()
        self._encoder = Encoder(source)
        self._heartbeat = HeartbeatSender(now=now)
        self._text_receiver = TextReceiver()
        self._answers: dict[int, m.CommandAck | None] = {}
        self._outgoing: list[m.Message] = []
        self._requests: list[m.Message] = []

    def __repr__(self) -> str:
        return f"Conversation({self.rover}, {self.monitor!r})"

    @property
    def target(self) -> Address:
        """The rover's autopilot; it must have been heard."""
        assert self.rover is not None
        return self.rover

    @property
    def armed(self) -> bool:
        return self.monitor is not None and self.monitor.armed

    @property
    def mode(self) -> int:
        """The custom_mode that it showed last; -1: none."""
        return -1 if self.monitor is None else self.monitor.custom_mode

    # time and packets

    def receive(self, packet: Packet, *, now: float) -> None:
        self.now = now
        is_rover = packet.source == self.rover
        if is_rover:
            self.counts[packet.message_id] += 1
        if packet.message_id not in USED:
            return
        message = self._decoder.decode(packet)
        if message is None:
            return
        self.others.receive(packet, message)
        if self.rover is None and isinstance(message, m.Heartbeat):
            self._meet(packet, message)
        elif is_rover:
            self._hear(packet, message)

    def handle_deadline(self, *, now: float) -> None:
        """Repeat and give up what is due; say that we are here."""
        self.now = now
        if self._heartbeat.is_due(now=now):
            self.send(gcs_heartbeat())
        self.sender.handle_deadline(now=now)
        for text in self._text_receiver.handle_deadline(now=now):
            self._note_text(text.words)
        self._take_answers()

    def next_deadline(self) -> float:
        beat_at, text_at = self._heartbeat.next_deadline(), self._text_receiver.next_deadline()
        return min(beat_at, text_at, self.sender.next_deadline())

    def take_packets(self) -> list[bytes]:
        """Return what is to be sent since the last call, in order."""
        self._take_answers()
        requests, self._requests = self._requests, []
        setpoints = [] if self.control is None else self.control.take_messages()
        holds_first = self.control is not None and self.control.holds_first
        in_order = (requests, setpoints) if holds_first else (setpoints, requests)
        messages = [*self._outgoing, *in_order[0], *in_order[1]]
        self._outgoing = []
        return [self._encoder.encode(message) for message in messages]

    def emergency_stop_packets(self) -> list[bytes]:
        """Return zero, HOLD and disarming, for an end on which nothing can be waited for.

        None where nothing is in our hands.
        """
        control = self.control
        if control is None or not (control.is_engaged or control.we_armed):
            return []
        words: list[m.Message] = [*control.zero_and_hold()]
        if control.we_armed:
            disarm = MavCmd.COMPONENT_ARM_DISARM
            words.append(m.CommandLong(*self.target, disarm, 0, 0, 0, 0, 0, 0, 0, 0))
        return [self._encoder.encode(message) for message in words]

    # what the steps ask

    def send(self, message: m.Message) -> None:
        self._outgoing.append(message)

    def ask(self, command: MavCmd, *params: float, component: int = AUTOPILOT) -> Steps[str]:
        """Send a command until it is answered; gives the result's name, "no answer" for none."""
        filled = (*params, *(0.0,) * (7 - len(params)))
        message = m.CommandLong(self.target.system_id, component, command, 0, *filled)
        self._answers.pop(command, None)
        self.sender.request(message, now=self.now, give_up_after=GIVE_UP)
        yield Wait(lambda: command in self._answers, GIVE_UP + 1.0)
        ack = self._answers.get(command)
        return NO_ANSWER if ack is None else result_name(ack.result)

    def ask_to_show(self) -> None:
        """Have the rover send a heartbeat now; one that does not, sends its own each second."""
        command = MavCmd.REQUEST_MESSAGE
        self.send(m.CommandLong(*self.target, command, 0, m.Heartbeat.id, 0, 0, 0, 0, 0, 0))

    def begin_control(self, persona: Persona) -> OffboardControl:
        """Return the hold on the rover; it does nothing yet."""
        self.control = OffboardControl(self.target, persona, self.sender, self.watch)
        self.control.heard(armed=self.armed, mode=self.mode, now=self.now)
        return self.control

    def _meet(self, packet: Packet, heartbeat: m.Heartbeat) -> None:
        if packet.component_id != AUTOPILOT or heartbeat.type in NOT_VEHICLES:
            return
        if self._wanted_id not in (None, packet.system_id) or packet.system_id == 0:
            return
        self.rover = packet.source
        self.others.system_id = packet.system_id
        lost_after = self.watch.heartbeat_lost
        self.monitor = HeartbeatMonitor(heartbeat, lost_after=lost_after, now=self.now)
        self.latest[m.Heartbeat.id] = heartbeat

    def _hear(self, packet: Packet, message: m.Message) -> None:
        self.latest[packet.message_id] = message
        match message:
            case m.Heartbeat():
                assert self.monitor is not None
                self.monitor.receive(message, now=self.now)
                if self.control is not None:
                    self.control.heard(armed=self.armed, mode=self.mode, now=self.now)
            case m.CommandAck():
                self.sender.receive(message, component=packet.component_id, now=self.now)
                self._take_answers()
            case m.Attitude() | m.LocalPositionNed():
                self.motion.receive(message, now=self.now)
            case m.ParamValue():
                self.parameters[message.param_id] = message
            case m.MessageInterval():
                self.intervals[message.message_id] = message.interval_us
            case m.Statustext():
                for text in self._text_receiver.receive(packet.source, message, now=self.now):
                    self._note_text(text.words)

    def _note_text(self, words: str) -> None:
        if len(self.texts) < MOST_TEXTS:
            self.texts.append("".join(each if each.isprintable() else "?" for each in words))

    def _take_answers(self) -> None:
        outgoing, answers = self.sender.take()
        self._requests += [each for each in outgoing if not isinstance(each, Packet)]
        for answer in answers:
            if is_request_of(answer) and self.control is not None:
                self.control.answered(answer, now=self.now)
            self._answers[answer.command] = answer.ack


def result_name(result: int) -> str:
    known = {each.value: each.name for each in MavResult}
    return known.get(result, f"result {result}")
