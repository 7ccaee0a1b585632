"""The simulated flight stack: messages in, messages and wheel demands out. Pure, no clock, no I/O.

It behaves like the autopilot of its persona. This file connects the parts and passes each message
to one of them; the parts have the rules.
"""

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import BROADCAST, Address
from mav_tasks.mavlink.codec import target_of
from mav_tasks.mavlink.enums import MavResult, MavSeverity
from mav_tasks.mavlink.messages import Message
from rover_sim.actuators import Motion, with_frozen
from rover_sim.ardupilot_drive import ArduPilotDrive
from rover_sim.ardupilot_flight import ArduPilotFlight
from rover_sim.body import BodyState
from rover_sim.boot import Boot
from rover_sim.commands import Commands
from rover_sim.estimate import estimate_from
from rover_sim.estimator import Estimator
from rover_sim.faults import NO_FAULTS, Faults
from rover_sim.geo import Origin
from rover_sim.mission_storage import MissionStorage
from rover_sim.onboard import Onboard
from rover_sim.parameters import Parameters
from rover_sim.personas import Mode, Persona
from rover_sim.px4_drive import px4_drive
from rover_sim.px4_flight import Px4Flight
from rover_sim.realism import Realism
from rover_sim.setpoints import Destination, Global, Local
from rover_sim.sticks import Sticks
from rover_sim.streams import Streams
from rover_sim.telemetry import Telemetry
from rover_sim.timing import Departures

MEASURED = (m.Attitude.id, m.LocalPositionNed.id)  # clients steer by these
RUNTIME_INTERVAL = 30.0  # s, AP_Stats' flush_interval_ms
POSITIONS = (m.LocalPositionNed.id, m.GlobalPositionInt.id)
REBOOT_TIME = 1.0  # s; a restarting autopilot receives and sends nothing
#: s without satellites until the position is lost: PX4's EKF2_NOAID_TOUT; ArduPilot's EKF gives up
#: after 5 to 10 s
COASTS = 5.0
NAK, FILE_NOT_FOUND = 129, 10  # of MAVLink FTP
STACKS = {"ardupilot": (ArduPilotFlight, ArduPilotDrive), "px4": (Px4Flight, px4_drive)}


class Autopilot:
    """One rover's autopilot.

    Call ``handle`` for each message, ``step`` once per control period, and ``outbox.take`` after
    either. ``unix_offset`` is Unix time minus ``now``; with 0, SYSTEM_TIME says unknown.
    """

    def __init__(
        self,
        address: Address,
        *,
        persona: Persona,
        origin: Origin,
        unix_offset: float,
        truth: BodyState,
        now: float,
        realism: Realism,
        seed: int,
        uid: int,
    ) -> None:
        self.address = address
        self._persona = persona
        errors = realism.estimator
        self._estimator = None if errors is None else Estimator(errors, realism.pushing, seed=seed)
        self._departures = Departures(realism.timing, seed=seed)
        self._asked = 0.0  # m/s, the last demand
        self._outputs: Motion = (0.0, 0.0)  # of the motors
        self._unix_offset = unix_offset
        estimate = estimate_from(self._seen(truth), NO_FAULTS, None)
        on = self._on = Onboard(persona, realism, origin, uid, estimate, now)
        self.outbox = on.outbox
        #: to read or to preset
        self.parameters = on.parameters = Parameters(on)
        self.parameters[persona.system_id_parameter] = address.system_id
        #: the plans stored on board, for inspection
        self.missions = on.missions = MissionStorage(on)
        on.sticks = Sticks(on)
        self._home_told: Destination
        self._shown_mode: Mode
        self._clock_stopped_at = now  # time of the last step with a running clock
        self.boots = 0  #: number of restarts
        self._start(now)

    def __repr__(self) -> str:
        return f"Autopilot({self.address}, {self._flight!r})"

    def handle(self, message: Message, sender: Address, *, now: float) -> None:
        """Take one message; ignore it if it is addressed to others.

        Raise SimulatedCrash for a message that makes the real autopilot abort.
        """
        on = self._on
        if on.outbox.faults.deaf or now < on.started or not self._is_for_us(message):
            return
        name = f"on_{message.get_type().lower()}"
        for part in (self, self.missions, self.parameters):
            if (handler := getattr(part, name, None)) is not None:
                on.now = now
                handler(message, sender)
                self._announce()

    def step(self, truth: BodyState, *, now: float) -> Motion:
        """Advance by one control period; return forward speed and yaw rate for the wheels."""
        on, faults = self._on, self.faults
        on.now = now
        on.estimate = estimate_from(self._seen(truth), faults, on.estimate)
        if not faults.clock_frozen:
            self._clock_stopped_at = now
        if now < on.started:
            return 0.0, 0.0
        self._watch_satellites()
        demand = self._flight.demand()
        if self._flight.home != self._home_told:
            self._home_told, self._shown_mode = self._flight.home, self.mode
            if self._persona.home.is_told:
                self._send(m.HomePosition.id)
        on.missions.step()
        self._count_runtime()
        self._announce()
        for message_id in on.streams.take_due(now):
            self._send(message_id)
        self._asked = demand.speed
        outputs = self._drive.step(demand)
        if self._flight.armed:
            outputs = with_frozen(outputs, self._outputs, faults.outputs_frozen)
        self._outputs = outputs
        return outputs

    @property
    def armed(self) -> bool:
        """Whether the motors are live."""
        return self._flight.armed

    @property
    def mode(self) -> Mode:
        """The present mode."""
        return self._flight.mode

    @property
    def faults(self) -> Faults:
        """The present faults."""
        return self.outbox.faults

    def set_faults(self, faults: Faults) -> None:
        """Replace the faults; ``Faults()`` clears them all."""
        was_inside = not self.faults.outside_fence
        self.outbox.faults = faults
        if faults.outside_fence and was_inside:
            self._flight.leave_fence()

    def operator_mode(self, mode: Mode, *, now: float) -> None:
        """Change the mode like an RC switch; ignore a mode that the persona lacks."""
        self._on.now = now
        if mode in self._persona.modes.numbers:
            self._flight.enter(mode)
        self._announce()

    def operator_arm(self, armed: bool, *, now: float) -> None:
        """Arm or disarm at the vehicle."""
        self._on.now = now
        self._flight.set_armed(armed)
        self._announce()

    def operator_sticks(self, forward_speed: float, yaw_rate: float) -> None:
        """Hold the transmitter's sticks at this demand, m/s and rad/s."""
        self._on.sticks.hold(forward_speed, yaw_rate)

    def operator_pulses(self, throttle: int, steering: int) -> None:
        """Hold the transmitter's sticks at these pulses, in microseconds."""
        self._on.sticks.hold_pulses(throttle, steering)

    def reboot(self, *, now: float) -> None:
        """Restart with the initial state and clock; keep parameters and missions."""
        self.boots += 1
        self._start(now + REBOOT_TIME)

    def _is_for_us(self, message: Message) -> bool:
        target = target_of(message)
        if not self._persona.heeds_component:
            target = target._replace(component_id=BROADCAST)
        return target.reaches(self.address)

    def _seen(self, truth: BodyState) -> BodyState:
        return truth if self._estimator is None else self._estimator.see(truth, asked=self._asked)

    def _start(self, up_at: float) -> None:
        on, persona = self._on, self._persona
        on.started = up_at
        on.streams = Streams(persona.streams, up_at)
        on.boot = Boot(on.realism.boot, persona.boot_script, started=up_at)
        self._gps_lost_at: float | None = None
        self._is_position_gone = False
        self._runtime_due = up_at + RUNTIME_INTERVAL
        fly, drive = STACKS[persona.stack]
        self._flight = on.flight = fly(on)
        self._drive = drive(on)
        self._home_told, self._shown_mode = self._flight.home, self.mode
        self._telemetry = Telemetry(on, unix_offset=self._unix_offset)
        self._commands = Commands(on, self._send, lambda: self.reboot(now=on.now))

    def _send(self, message_id: int) -> bool:
        on = self._on
        if not self._telemetry.knows(message_id):
            return False
        if self._is_position_gone and message_id in POSITIONS:
            return True
        estimate = on.estimate
        if self.faults.not_finite and message_id in MEASURED:
            estimate = estimate.without_numbers
        now = self._clock_stopped_at if self.faults.clock_frozen else on.now
        message = self._telemetry.build(message_id, estimate, now)
        if message is not None:
            is_position = message_id == m.LocalPositionNed.id
            at = self._departures.position_at(now) if is_position else now
            on.outbox.send_at(message, at, now)
        return True

    def _watch_satellites(self) -> None:
        """End what needs a position, some seconds after the satellites are lost."""
        on = self._on
        if not self.faults.gps_lost:
            self._gps_lost_at, self._is_position_gone = None, False
            return
        if self._gps_lost_at is None:
            self._gps_lost_at = on.now
        if on.now - self._gps_lost_at >= COASTS and not self._is_position_gone:
            self._is_position_gone = True
            self._flight.lose_position()

    def _count_runtime(self) -> None:
        """Count the runtime parameter up; ArduPilot sends it unasked."""
        name, parameters = self._persona.runtime_parameter, self._on.parameters
        if name is not None and self._on.now >= self._runtime_due:
            self._runtime_due += RUNTIME_INTERVAL
            parameters.change(name, parameters[name] + RUNTIME_INTERVAL)

    def _announce(self) -> None:
        """Send a heartbeat at once if the mode changed, as some makes do."""
        last, self._shown_mode = self._shown_mode, self.mode
        if last is not self.mode and self._on.realism.timing.announces_mode:
            self._send(m.Heartbeat.id)

    # the method for a message has its name; missions and parameters have theirs

    def on_command_long(self, message: m.CommandLong | m.CommandInt, sender: Address) -> None:
        """Execute a command."""
        result = self._commands.execute(message)
        if result is not None:
            self._ack(message.command, result, sender)

    on_command_int = on_command_long

    def on_set_mode(self, message: m.SetMode, sender: Address) -> None:
        """Answer the deprecated message SET_MODE with a COMMAND_ACK, as autopilots do."""
        outcome = self._commands.set_mode(message.base_mode, message.custom_mode)
        result = self._commands.result_of(outcome)
        self._ack(self._persona.set_mode_acked_as, result, sender)

    def _ack(self, command: int, result: MavResult, sender: Address) -> None:
        at = self._departures.answer_at(self._on.now)
        self.outbox.send_at(m.CommandAck(command, result, 0, 0, *sender), at, self._on.now)

    def on_heartbeat(self, _message: m.Heartbeat, sender: Address) -> None:
        """Note a heartbeat from any system."""
        self._flight.hear_heartbeat(sender.system_id)

    def on_set_position_target_local_ned(self, message: Local | Global, _sender: Address) -> None:
        """Take a setpoint."""
        self._flight.take(message)

    on_set_position_target_global_int = on_set_position_target_local_ned

    def on_rc_channels_override(self, message: m.RcChannelsOverride, _sender: Address) -> None:
        """Take the sticks of a client."""
        self._on.sticks.take_override(message)

    def on_request_data_stream(self, message: m.RequestDataStream, _sender: Address) -> None:
        """Set the rate of a group of messages."""
        rate = message.req_message_rate if message.start_stop else 0
        self._on.streams.set_group(message.req_stream_id, rate, self._on.now)

    def on_mission_set_current(self, message: m.MissionSetCurrent, _sender: Address) -> None:
        """Continue with another mission item."""
        if not self._flight.skip_to_item(message.seq):
            self.outbox.say(MavSeverity.CRITICAL, "WPM: WP CURR CMD: Not in list")
        self._send(m.MissionCurrent.id)

    def on_timesync(self, message: m.Timesync, _sender: Address) -> None:
        """Answer a request for the time since boot; tc1 is 0 in requests only."""
        if message.tc1 == 0:
            boot_ns = int((self._on.now - self._on.started) * 1e9)
            self.outbox.send(m.Timesync(boot_ns, message.ts1))

    def on_file_transfer_protocol(self, message: m.FileTransferProtocol, sender: Address) -> None:
        """Refuse a file: without an answer a client would wait for seconds.

        MAVLink guide, "File Transfer Protocol": a NAK has the same session, the next sequence
        number, and the request's opcode.
        """
        low, high, session, opcode, *_ = message.payload
        seq = (low | high << 8) + 1 & 0xFFFF
        header = [seq & 0xFF, seq >> 8, session, NAK, 1, opcode, *(0,) * 6, FILE_NOT_FOUND]
        payload = header + [0] * (len(message.payload) - len(header))
        self.outbox.send(m.FileTransferProtocol(0, *sender, payload))
