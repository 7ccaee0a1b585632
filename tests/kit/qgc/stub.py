"""A vehicle with configurable, even wrong, answers, to test the station itself."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial

from pymavlink.dialects.v20 import all as mavlink
from pymavlink.generator.mavcrc import x25crc

from mav_tasks.links.memory import MemoryNet
from tests.kit.qgc.timers import Timers
from tests.kit.qgc.wire import PROTOCOL_VERSION, PROTOCOL_VERSION_EXTRA, Message

APM_AUTOPILOT, PX4_AUTOPILOT, GENERIC_AUTOPILOT = 3, 12, 0
VERSION, REQUEST = 148, 512
ACCEPTED, UNSUPPORTED = 0, 3
INT32 = 6

#: the five that prevent complaints at connect [11.2]
PX4_SET = {
    "SYS_AUTOSTART": 50000,
    "COM_RC_IN_MODE": 1,
    "CAL_GYRO0_ID": 1310988,
    "CAL_ACC0_ID": 1310988,
    "SYS_HAS_MAG": 0,
}
#: the 24 of ArduPilot [11.3]
APM_SET = {
    "SYSID_THISMAV": 1,
    **{f"RCMAP_{name}": n for n, name in enumerate(("ROLL", "PITCH", "THROTTLE", "YAW"), 1)},
    **{
        f"RC{n}_{what}": value
        for n in (1, 2, 3, 4)
        for what, value in (("MIN", 1000), ("MAX", 2000), ("TRIM", 1500))
    },
    **dict.fromkeys(("COMPASS_DEV_ID", "COMPASS_DEV_ID2", "COMPASS_DEV_ID3"), 0),
    **{f"INS_ACCOFFS_{axis}": 0.01 for axis in "XYZ"},
    "FRAME_CLASS": 1,
}


@dataclass
class Stub:
    """System 1 at the endpoint that stations dial. Times in seconds, results as numbers."""

    net: MemoryNet
    name: str
    autopilot: int = PX4_AUTOPILOT
    parameters: dict[str, float] = field(default_factory=lambda: dict(PX4_SET))
    capabilities: int = 4 | 8 | 0x2000 | 0x4000 | 0x8000
    sw_version: int = 1 << 24 | 14 << 16
    mode: int = 0x03040000
    armed: bool = False
    landed_state: int = 1
    #: names of messages to ignore
    silent: set[str] = field(default_factory=set)
    #: ids of REQUEST_MESSAGE to ignore
    silent_requests: set[int] = field(default_factory=set)
    #: answers to a command: (delay, result, component) each; other commands are accepted
    answers: dict[int, list[tuple[float, int, int]]] = field(default_factory=dict)
    #: modes are accepted, and shown at once
    takes_modes: bool = True
    #: item of an upload: result sent instead of the next message; -1 is the count, None silence
    upload_results: dict[int, int | None] = field(default_factory=dict)
    #: skips every n-th sequence number
    leaves_out_each: int | None = None
    #: components 1 and 191 share a sequence counter
    counts_together: bool = False

    def __post_init__(self) -> None:
        self._link = self.net.link(self.name)
        self._timers = Timers(now=self.net.now)
        self._seqs: dict[int, int] = {}
        self._peers: dict[str, None] = {}
        self._parser = mavlink.MAVLink(None)
        self._count: dict[int, int] = {}
        self.heard: list[tuple[float, str, Message]] = []
        self.talks = True
        self._timers.after(0.0, self._beat)

    # Party

    def next_deadline(self) -> float | None:
        """Return when ``turn`` is due, unless something arrives before."""
        return self._timers.next_deadline()

    def turn(self, *, now: float) -> None:
        """Read what arrived, answer, send what is due."""
        self._timers.handle_deadline(now=now)
        for peer, data in self._link.receive(len(self._link.arrived)):
            self._peers[str(peer)] = None
            for message in self._parser.parse_buffer(data) or ():
                self.heard.append((now, message.get_type(), message))
                if message.get_type() not in self.silent and self.talks:
                    self._take(message)

    # periodic messages

    def heartbeat(self) -> None:
        """Send the heartbeat now."""
        base, status = 1 | (128 if self.armed else 0), 4 if self.armed else 3
        self.send(mavlink.MAVLink_heartbeat_message(10, self.autopilot, base, self.mode, status, 3))

    def send(self, message: Message, *, component: int = 1) -> None:
        """Send a message to all peers so far."""
        mav = mavlink.MAVLink(None, 1, component)
        mav.seq = self._next_seq(component)
        raw: bytes = message.pack(mav)
        for peer in self._peers:
            self._link.send(peer, raw)

    def say(self, severity: int, text: str, *, component: int = 1) -> None:
        """Send a text, in chunks if necessary."""
        pieces = [text[i : i + 50] for i in range(0, max(len(text), 1), 50)]
        for number, piece in enumerate(pieces):
            message = mavlink.MAVLink_statustext_message(
                severity, piece.encode(), 7 if len(pieces) > 1 else 0, number
            )
            self.send(message, component=component)

    def telemetry(self) -> None:
        """Send its place, its home, and its landed state."""
        self.send(mavlink.MAVLink_extended_sys_state_message(0, self.landed_state))
        self.send(
            mavlink.MAVLink_global_position_int_message(
                0, 473977418, 85455938, 488000, 0, 0, 0, 0, 0
            )
        )
        self.send(
            mavlink.MAVLink_home_position_message(
                473977418, 85455938, 488000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0
            )
        )

    def _beat(self) -> None:
        if self.talks:
            self.heartbeat()
            self.telemetry()
            self.send(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3), component=191)
        self._timers.after(1.0, self._beat)

    def _next_seq(self, component: int) -> int:
        counter = 0 if self.counts_together else component
        seq = self._seqs.get(counter, 0)
        step = 1
        if self.leaves_out_each is not None and seq % self.leaves_out_each == 0:
            step = 2
        self._seqs[counter] = (seq + step) % 256
        return seq

    # answers

    def _take(self, message: Message) -> None:
        match message.get_type():
            case "COMMAND_LONG" | "COMMAND_INT":
                self._take_command(message)
            case "SET_MODE":
                self._change_mode(message.custom_mode)
            case "PARAM_REQUEST_LIST":
                for index in range(len(self.parameters)):
                    self._send_parameter(index)
            case "PARAM_REQUEST_READ" if message.param_index >= 0:
                self._send_parameter(message.param_index)
            case "FILE_TRANSFER_PROTOCOL":
                nak = [0, 0, 0, 129, 1, message.payload[3], 0, 0, 0, 0, 0, 0, 10] + [0] * 238
                self.send(mavlink.MAVLink_file_transfer_protocol_message(0, 255, 190, nak))
            case "MISSION_REQUEST_LIST":
                kind = message.mission_type
                self.send(mavlink.MAVLink_mission_count_message(255, 190, 0, kind))
            case "MISSION_COUNT":
                self._count[message.mission_type] = message.count
                self._ask_item(-1, message.mission_type)
            case "MISSION_ITEM_INT":
                self._ask_item(message.seq, message.mission_type)
            case "MISSION_ITEM" | "MISSION_CLEAR_ALL":
                self._mission_ack(0, message.mission_type)

    def _take_command(self, message: Message) -> None:
        number = message.command
        if number == REQUEST:
            wanted = int(message.param1)
            if wanted in self.silent_requests:
                return
            result = ACCEPTED if self._send_message(wanted) else UNSUPPORTED
            self._ack(number, result, message.target_component)
            return
        if number == 400:
            self.armed = message.param1 == 1
            self.landed_state = 2 if self.armed else 1
        if number == 176:
            self._change_mode(int(message.param2))
        for delay, result, component in self.answers.get(number, [(0.0, ACCEPTED, 1)]):
            self._later(delay, partial(self._ack, number, result, component))
        if number == 400:
            self.heartbeat()
            self.telemetry()

    def _later(self, delay: float, call: Callable[[], None]) -> None:
        if delay:
            self._timers.after(delay, call)
        else:
            call()

    def _ack(self, number: int, result: int, component: int) -> None:
        ack = mavlink.MAVLink_command_ack_message(number, result, 0, 0, 254, 7)  # to nobody here
        self.send(ack, component=component)

    def _change_mode(self, mode: int) -> None:
        if self.takes_modes:
            self.mode = mode
            self.heartbeat()

    def _send_message(self, number: int) -> bool:
        if number == VERSION:
            self.send(
                mavlink.MAVLink_autopilot_version_message(
                    self.capabilities, self.sw_version, 0, 0, 0, *([0] * 8,) * 3, 0, 0, 1
                )
            )
            return True
        if number == PROTOCOL_VERSION:
            self._send_protocol_version()
            return True
        return False

    def _send_protocol_version(self) -> None:
        payload = b"\xc8\x00\x64\x00\xc8\x00"
        number = PROTOCOL_VERSION.to_bytes(3, "little")
        packet = bytes([len(payload), 0, 0, self._next_seq(1), 1, 1]) + number + payload
        crc = x25crc(packet)
        crc.accumulate(bytes([PROTOCOL_VERSION_EXTRA]))
        for peer in self._peers:
            self._link.send(peer, b"\xfd" + packet + crc.crc.to_bytes(2, "little"))

    def _send_parameter(self, index: int) -> None:
        names: Iterable[tuple[str, float]] = list(self.parameters.items())[index : index + 1]
        for name, value in names:
            count, as_sent, kind = len(self.parameters), value, 9
            self.send(
                mavlink.MAVLink_param_value_message(name.encode(), as_sent, kind, count, index)
            )

    def _ask_item(self, last: int, kind: int) -> None:
        if last in self.upload_results and kind == 0:
            result = self.upload_results[last]
            if result is not None:
                self._mission_ack(result, kind)
        elif last + 1 < self._count[kind]:
            self.send(mavlink.MAVLink_mission_request_int_message(255, 190, last + 1, kind))
        else:
            self._mission_ack(0, kind)

    def _mission_ack(self, result: int, kind: int) -> None:
        self.send(mavlink.MAVLink_mission_ack_message(255, 190, result, kind))
