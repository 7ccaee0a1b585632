"""The simulated flight stack: messages in, messages and wheel demands out. Pure, no clock, no I/O.

It behaves like the autopilot of its persona. This file connects the parts and passes each message
to one of them; the parts have the rules.
"""

from collections.abc import Mapping

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.address import AUTOPILOT, BROADCAST, Address
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.mavlink.messages import Message
from rover_sim.actuators import Motion, with_frozen
from rover_sim.available_modes import available_modes
from rover_sim.body import BodyState
from rover_sim.boot import Boot
from rover_sim.commands import CommandParts, CommandReceiver
from rover_sim.dispatch import Handler
from rover_sim.estimate import Estimate, estimate_from
from rover_sim.estimator import Estimator
from rover_sim.faults import NO_FAULTS, Faults
from rover_sim.file_transfer import refusal_of
from rover_sim.flight import FlightControl
from rover_sim.flight_rules import FlightParts
from rover_sim.geo import Origin
from rover_sim.gps_loss import GpsLoss
from rover_sim.home import Follower
from rover_sim.mission_storage import MissionStorage
from rover_sim.outbox import Outbox
from rover_sim.parameters import Parameters
from rover_sim.personas import Mode, Persona
from rover_sim.realism import Realism
from rover_sim.setpoints import Destination
from rover_sim.sticks import Sticks
from rover_sim.streams import Streams
from rover_sim.telemetry import Telemetry
from rover_sim.timing import Departures

MEASURED = (messages.Attitude.id, messages.LocalPositionNed.id)  # clients steer by these
RUNTIME_INTERVAL = 30.0  # s, AP_Stats' flush_interval_ms
POSITIONS = (messages.LocalPositionNed.id, messages.GlobalPositionInt.id)
FASTEST = 5.0  # m/s, the speed limit if the parameter sets none
REBOOT_TIME = 1.0  # s; a restarting autopilot receives and sends nothing


class Autopilot:
    """One rover's autopilot, address (system_id, 1).

    Call ``handle`` for each message, ``step`` once per control period, and ``take_messages`` after
    either. ``unix_offset`` is Unix time minus ``now``; with 0, SYSTEM_TIME says unknown.
    """

    def __init__(
        self,
        *,
        system_id: int,
        persona: Persona,
        origin: Origin,
        unix_offset: float,
        truth: BodyState,
        now: float,
        realism: Realism,
        seed: int,
    ) -> None:
        self.address = Address(system_id, AUTOPILOT)
        self._persona = persona
        self._realism = realism
        self._estimator = (
            None if realism.estimator is None else Estimator(realism.estimator, seed=seed)
        )
        self._departures = Departures(realism.timing, seed=seed)
        self._sticks = Sticks(realism.stick_speed)
        self._asked = 0.0  # m/s, the last demand
        self._outputs: Motion = (0.0, 0.0)  # of the motors
        self._origin = origin
        self._unix_offset = unix_offset
        self._outbox = Outbox()
        self._parameters = Parameters(persona.parameters, self._outbox, bytewise=persona.bytewise)
        self._parameters[persona.system_id_parameter] = system_id
        self._missions = MissionStorage(
            conventions=persona.missions, origin=origin, outbox=self._outbox
        )
        self._estimate: Estimate = estimate_from(self._seen(truth), NO_FAULTS, None)
        self._faults = NO_FAULTS
        self._clock_stopped_at = now  # time of the last step with a running clock
        self.boots = 0  #: number of restarts
        self._home_told: Destination
        self._start(now)

    def __repr__(self) -> str:
        return f"Autopilot({self.address}, {self._flight!r})"

    def handle(self, message: Message, sender: Address, *, now: float) -> None:
        """Take one message; ignore it if it is addressed to others.

        Raise SimulatedCrash for a message that makes the real autopilot abort.
        """
        if self._faults.deaf or now < self._up_at or not self._is_for_us(message):
            return
        if (handler := self._handlers.get(message.get_msgId())) is not None:
            handler(message, sender, now)
            self._announce(now)

    def step(self, truth: BodyState, *, now: float) -> tuple[float, float]:
        """Advance by one control period; return forward speed and yaw rate for the wheels."""
        self._estimate = estimate_from(self._seen(truth), self._faults, self._estimate)
        if not self._faults.clock_frozen:
            self._clock_stopped_at = now
        if now < self._up_at:
            return 0.0, 0.0
        if self._gps.watch(self._faults, now=now):
            self._flight.lose_position()
        demand = self._flight.demand(self._estimate, now=now)
        if self._flight.home != self._home_told:
            self._home_told = self._flight.home
            if self._persona.home.is_told:
                self._send(messages.HomePosition.id, now)
        self._missions.step(now=now)
        self._count_runtime(now)
        self._announce(now)
        for message_id in self._streams.take_due(now=now):
            self._send(message_id, now)
        self._asked = demand.speed
        outputs = self._motion.step(demand, truth, self._estimate)
        if self._flight.armed:
            outputs = with_frozen(outputs, self._outputs, self._faults.outputs_frozen)
        self._outputs = outputs
        return outputs

    def take_messages(self) -> list[Message]:
        """Return the messages to send, each to everybody on the link."""
        return self._outbox.take()

    @property
    def next_release(self) -> float:
        """Time at which the next delayed message is due; infinity if there is none."""
        return self._outbox.next_release

    def release(self, *, now: float) -> None:
        """Send the delayed messages that are due."""
        self._outbox.release(now=now)

    @property
    def armed(self) -> bool:
        """Whether the motors are live."""
        return self._flight.armed

    @property
    def mode(self) -> Mode:
        """The present mode."""
        return self._flight.mode

    @property
    def missions(self) -> MissionStorage:
        """The plans stored on board, for inspection."""
        return self._missions

    @property
    def parameters(self) -> Parameters:
        """The parameters, to read or to preset."""
        return self._parameters

    @property
    def faults(self) -> Faults:
        """The present faults."""
        return self._faults

    def set_faults(self, faults: Faults) -> None:
        """Replace the faults; ``Faults()`` clears them all."""
        was_inside = not self._faults.outside_fence
        self._faults = self._outbox.faults = self._flight.faults = faults
        if faults.outside_fence and was_inside:
            self._flight.leave_fence()

    def operator_mode(self, mode: Mode, *, now: float) -> None:
        """Change the mode like an RC switch; ignore a mode that the persona lacks."""
        if mode in self._persona.modes.numbers:
            self._flight.enter(mode)
        self._announce(now)

    def operator_arm(self, armed: bool, *, now: float) -> None:
        """Arm or disarm at the vehicle."""
        self._flight.set_armed(armed)
        self._announce(now)

    def operator_sticks(self, forward_speed: float, yaw_rate: float) -> None:
        """Hold the sticks (m/s, rad/s) until the mode changes; for MANUAL and POSITION."""
        self._flight.set_sticks(forward_speed, yaw_rate)
        self._sticks.hold(forward_speed, yaw_rate)

    def operator_pulses(self, throttle: int, steering: int) -> None:
        """Hold the transmitter's sticks at these pulses, in microseconds."""
        self._sticks.hold_pulses(throttle, steering)

    def reboot(self, *, now: float) -> None:
        """Restart with the initial state and clock; keep parameters and missions."""
        self.boots += 1
        self._start(now + REBOOT_TIME)

    def _is_for_us(self, message: Message) -> bool:
        target = getattr(message, "target_system", BROADCAST)
        if target not in (BROADCAST, self.address.system_id):
            return False
        component = getattr(message, "target_component", BROADCAST)
        ours = (BROADCAST, self.address.component_id)
        return component in ours or not self._persona.heeds_component

    def _seen(self, truth: BodyState) -> BodyState:
        return truth if self._estimator is None else self._estimator.see(truth, asked=self._asked)

    def _start(self, up_at: float) -> None:
        outbox, missions, persona = self._outbox, self._missions, self._persona
        realism = self._realism
        self._up_at = up_at
        self._gps = GpsLoss()
        self._runtime_due = up_at + RUNTIME_INTERVAL
        self._streams = Streams(persona.streams, now=up_at)
        boot = Boot(realism.boot, persona.boot_script, started=up_at)
        self._motion = persona.drive(persona.frame, self._parameters)
        rules = persona.rules(
            FlightParts(
                origin=self._origin,
                parameters=self._parameters,
                missions=missions,
                outbox=outbox,
                speed_limit=self._speed_limit,
                honours_yaw_rate=persona.honours_yaw_rate,
                started=up_at,
                frame=persona.frame,
                settling_time=realism.boot.armable if realism.boot.is_none else 0.0,
            )
        )
        self._flight = FlightControl(
            modes=persona.modes,
            rules=rules,
            missions=missions,
            outbox=outbox,
            home=Destination(self._estimate.north, self._estimate.east),
            boot=boot,
            sticks=self._sticks,
            follower=Follower(persona.home),
        )
        self._flight.faults = self._faults
        self._home_told = self._flight.home
        missions.go_to = self._go_to_item
        self._telemetry = Telemetry(
            persona=persona,
            system_id=self.address.system_id,
            origin=self._origin,
            flight=self._flight,
            missions=missions,
            unix_offset=self._unix_offset,
            started=up_at,
            realism=realism,
            boot=boot,
            sticks=self._sticks,
        )
        commands = CommandParts(
            origin=self._origin,
            flight=self._flight,
            missions=missions,
            streams=self._streams,
            outbox=outbox,
            send_now=self._send,
            reboot=lambda now: self.reboot(now=now),
            modes=available_modes(persona.offered_modes, persona.modes),
        )
        self._commands = CommandReceiver(persona.commands(commands), outbox, self._departures)
        self._handlers = self._make_handlers()

    def _speed_limit(self) -> float:
        """Return the speed limit in m/s; a parameter of 0 or less means "no limit" (PX4)."""
        limit = self._parameters[self._persona.speed_parameter]
        return limit if limit > 0.0 else FASTEST

    def _make_handlers(self) -> Mapping[int, Handler]:
        return {
            **self._missions.handlers,
            **self._parameters.handlers,
            **self._commands.handlers,
            messages.Heartbeat.id: self._handle_heartbeat,
            messages.SetPositionTargetLocalNed.id: self._handle_local_target,
            messages.SetPositionTargetGlobalInt.id: self._handle_global_target,
            messages.RequestDataStream.id: self._handle_request_data_stream,
            messages.MissionSetCurrent.id: self._handle_mission_set_current,
            messages.Timesync.id: self._handle_timesync,
            messages.RcChannelsOverride.id: self._handle_override,
            messages.FileTransferProtocol.id: self._handle_file_transfer,
        }

    def _send(self, message_id: int, now: float) -> bool:
        if not self._telemetry.knows(message_id):
            return False
        if self._gps.is_position_gone and message_id in POSITIONS:
            return True
        estimate = self._estimate
        if self._faults.not_finite and message_id in MEASURED:
            estimate = estimate.without_numbers
        if self._faults.clock_frozen:
            now = self._clock_stopped_at
        message = self._telemetry.build(message_id, estimate, now=now)
        if message is not None:
            is_position = message_id == messages.LocalPositionNed.id
            at = self._departures.position_at(now=now) if is_position else now
            self._outbox.send_at(message, at, now=now)
        return True

    def _count_runtime(self, now: float) -> None:
        """Count the runtime parameter up; ArduPilot sends it unasked."""
        name = self._persona.runtime_parameter
        if name is not None and now >= self._runtime_due:
            self._runtime_due += RUNTIME_INTERVAL
            self._parameters.change(name, self._parameters[name] + RUNTIME_INTERVAL)

    def _go_to_item(self, place: Destination, now: float) -> bool:
        flight = self._flight
        return flight.can_reposition and flight.reposition(place, now=now)

    def _announce(self, now: float) -> None:
        """Send a heartbeat at once if a change occurred that this autopilot announces."""
        if self._flight.take_changes() & self._realism.timing.announces:
            self._send(messages.Heartbeat.id, now)

    def _handle_heartbeat(self, _message: messages.Heartbeat, sender: Address, now: float) -> None:
        self._flight.hear_heartbeat(sender.system_id, now=now)

    def _handle_local_target(
        self, message: messages.SetPositionTargetLocalNed, _sender: Address, now: float
    ) -> None:
        self._flight.take_local(message, self._estimate, now=now)

    def _handle_global_target(
        self, message: messages.SetPositionTargetGlobalInt, _sender: Address, now: float
    ) -> None:
        self._flight.take_global(message, self._estimate, now=now)

    def _handle_override(
        self, message: messages.RcChannelsOverride, _sender: Address, now: float
    ) -> None:
        if self._realism.stick_speed is not None:
            self._sticks.take_override(message, now=now)

    def _handle_request_data_stream(
        self, message: messages.RequestDataStream, _sender: Address, now: float
    ) -> None:
        rate = message.req_message_rate if message.start_stop else 0
        self._streams.set_group(message.req_stream_id, rate, now=now)

    def _handle_mission_set_current(
        self, message: messages.MissionSetCurrent, _sender: Address, now: float
    ) -> None:
        if not self._flight.skip_to_item(message.seq):
            self._outbox.say(MavSeverity.CRITICAL, "WPM: WP CURR CMD: Not in list")
        self._send(messages.MissionCurrent.id, now)

    def _handle_timesync(self, message: messages.Timesync, _sender: Address, now: float) -> None:
        if message.tc1 == 0:  # 0 marks a request; other values are responses
            boot_ns = int((now - self._up_at) * 1e9)
            self._outbox.send(messages.Timesync(boot_ns, message.ts1))

    def _handle_file_transfer(
        self, message: messages.FileTransferProtocol, sender: Address, _now: float
    ) -> None:
        self._outbox.send(messages.FileTransferProtocol(0, *sender, refusal_of(message.payload)))
