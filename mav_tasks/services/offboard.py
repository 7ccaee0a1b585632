"""Driving a vehicle from outside: take control, stream velocity setpoints, hand back, stop.

MAVLink guide, "Offboard Control Interface". Steps for ArduPilot: its GUIDED mode, one zero setpoint
(it keeps a setpoint from before and would drive off when armed: observed), arm, zeros until seen
armed, and only then motion. A mode or arm request is believed when a HEARTBEAT shows it, not when
it is acknowledged. The caller calls one of ``take``, ``drive``, ``release`` or ``stop`` at each
setpoint period; each does the next thing that is due.
"""

from enum import Enum, auto
from math import isfinite

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavModeFlag, MavResult
from mav_tasks.mavlink.messages import CommandLong, Message, SetPositionTargetLocalNed
from mav_tasks.services.command_sender import Answered, CommandSender
from mav_tasks.services.persona import Persona
from mav_tasks.settings import Watch

STOP_REPEAT = 0.5  # s, between the HOLD requests of a STOP that is not confirmed yet
RELEASE_REPEAT = 1.0  # s, the same of a hand-back


class Phase(Enum):
    """How far control of the vehicle has come."""

    #: it is not ours; nothing is sent
    IDLE = auto()
    #: our mode is asked for
    ASKING_MODE = auto()
    #: in our mode; arming is asked for, zeros are streamed
    ASKING_ARM = auto()
    #: in our mode and seen armed: setpoints move it
    CONTROL = auto()
    #: standing, HOLD is asked for
    RELEASING = auto()
    #: HOLD seen after a release that disarms; disarming is asked for
    DISARMING = auto()
    #: STOP: zeros and HOLD until confirmed
    STOPPING = auto()


class Refused(Enum):
    """What the vehicle would not do."""

    MODE = auto()
    ARM = auto()


class OffboardControl:
    """Our hold on one vehicle."""

    def __init__(
        self, target: Address, persona: Persona, sender: CommandSender, watch: Watch
    ) -> None:
        self._target = target
        self._persona = persona
        self._sender = sender
        self._watch = watch
        self._armed = False
        self._mode = -1
        self._outgoing: list[Message] = []
        self._next_hold_at = 0.0
        self._hold_asked_at: float | None = None
        self._stop_confirmed = False
        self.phase = Phase.IDLE
        self.refused: Refused | None = None
        self.we_armed = False

    def __repr__(self) -> str:
        return f"OffboardControl({self.phase.name}, mode={self._mode}, armed={self._armed})"

    @property
    def in_control(self) -> bool:
        """Whether a non-zero setpoint may be sent."""
        return self.phase is Phase.CONTROL and self._armed and self._in_our_mode

    @property
    def is_engaged(self) -> bool:
        """Whether we are doing anything to the vehicle."""
        return self.phase is not Phase.IDLE

    @property
    def is_stop_confirmed(self) -> bool:
        """Whether HOLD and standstill were seen since the last ``begin_stop``."""
        return self._stop_confirmed

    @property
    def _in_our_mode(self) -> bool:
        return self._mode == self._persona.control_mode

    def asked_for_hold_since(self, since: float) -> bool:
        """Whether we requested HOLD at or after ``since``: a change to it may be our own."""
        return self._hold_asked_at is not None and self._hold_asked_at >= since

    def take_messages(self) -> list[Message]:
        """Give the setpoints to send since the last call."""
        outgoing, self._outgoing = self._outgoing, []
        return outgoing

    def heard(self, *, armed: bool, mode: int) -> None:
        """Take in what a HEARTBEAT of the vehicle says."""
        if self._armed and not armed:
            self.we_armed = False
        self._armed = armed
        self._mode = mode

    def answered(self, answer: Answered) -> None:
        """Take in the vehicle's answer to a mode or arm request of ours."""
        if answer.ack is not None and answer.ack.result == MavResult.ACCEPTED:
            return
        silent = answer.ack is None
        if self.phase is Phase.ASKING_MODE and answer.command == MavCmd.DO_SET_MODE:
            self.refused = None if silent and self._in_our_mode else Refused.MODE
        elif self.phase is Phase.ASKING_ARM and answer.command == MavCmd.COMPONENT_ARM_DISARM:
            self.refused = None if silent and self._armed else Refused.ARM
        elif self.phase is Phase.DISARMING and answer.command == MavCmd.COMPONENT_ARM_DISARM:
            self.phase = Phase.IDLE

    def lose(self) -> None:
        """Somebody else has the vehicle, or may have: send not one thing more."""
        self._withdraw_requests()
        self._outgoing.clear()
        self.phase = Phase.IDLE
        self.we_armed = False

    def take(self, *, may_arm: bool, now: float) -> None:
        """Get into control, one step a call; never moves the vehicle."""
        match self.phase:
            case Phase.IDLE | Phase.RELEASING | Phase.DISARMING | Phase.STOPPING:
                self._withdraw_requests()
                self.refused = None
                self.phase = Phase.ASKING_MODE
                if not self._in_our_mode:
                    self._request_mode(self._persona.control_mode, now=now)
                else:
                    self._arm_next(may_arm=may_arm, now=now)
            case Phase.ASKING_MODE if self._in_our_mode:
                self._arm_next(may_arm=may_arm, now=now)
            case Phase.ASKING_ARM if self._armed and self._in_our_mode:
                self._send_setpoint(0.0, 0.0)
                self.phase = Phase.CONTROL
            case Phase.CONTROL if not (self._armed and self._in_our_mode):
                self.phase = Phase.IDLE
                self.take(may_arm=may_arm, now=now)
            case Phase.ASKING_ARM | Phase.CONTROL:
                self._send_setpoint(0.0, 0.0)

    def drive(self, forward: float, yaw_rate: float) -> None:
        """Send a velocity setpoint, m/s and rad/s; zeros unless ``in_control``."""
        if self.phase in (Phase.ASKING_ARM, Phase.CONTROL):
            moving = self.in_control and isfinite(forward) and isfinite(yaw_rate)
            self._send_setpoint(*((forward, yaw_rate) if moving else (0.0, 0.0)))

    def release(self, *, still: bool, disarm: bool, now: float) -> None:
        """Zeros until the vehicle stands, then HOLD until seen, then nothing more.

        With ``disarm`` a vehicle that we armed is disarmed in the end.
        """
        match self.phase:
            case Phase.ASKING_MODE:
                self.begin_release(now=now)
            case Phase.ASKING_ARM | Phase.CONTROL:
                self._send_setpoint(0.0, 0.0)
                self._withdraw(MavCmd.COMPONENT_ARM_DISARM)
                if still:
                    self.begin_release(now=now)
            case Phase.RELEASING if self._mode == self._persona.hold_mode:
                self._withdraw(MavCmd.DO_SET_MODE)
                self._end_release(disarm=disarm, now=now)
            case Phase.RELEASING:
                self._send_setpoint(0.0, 0.0)
                if now >= self._next_hold_at:
                    self._request_hold(now=now, again_after=RELEASE_REPEAT)
            case Phase.DISARMING if not self._armed:
                self.phase = Phase.IDLE

    def begin_release(self, *, now: float) -> None:
        """Zero and HOLD at once, on a vehicle in whatever mode; ``release`` sees it through."""
        self._withdraw_requests()
        self.phase = Phase.RELEASING
        self._send_setpoint(0.0, 0.0)
        self._request_hold(now=now, again_after=RELEASE_REPEAT)

    def begin_stop(self, *, now: float) -> None:
        """Zero and HOLD at once, ahead of whatever was asked for; ``stop`` repeats them."""
        self._withdraw_requests()
        self.phase = Phase.STOPPING
        self._stop_confirmed = False
        self._send_setpoint(0.0, 0.0)
        self._request_hold(now=now, again_after=STOP_REPEAT)

    def stop(self, *, still: bool, now: float) -> None:
        """Repeat zero and HOLD until HOLD is seen and the vehicle measured to stand."""
        if self.phase is not Phase.STOPPING:
            return
        if still and self._mode == self._persona.hold_mode:
            self._withdraw_requests()
            self._stop_confirmed = True
            self.phase = Phase.IDLE
            return
        self._send_setpoint(0.0, 0.0)
        if now >= self._next_hold_at:
            self._request_hold(now=now, again_after=STOP_REPEAT)

    def zero_setpoint(self) -> SetPositionTargetLocalNed:
        """Give the setpoint that asks the vehicle to stand."""
        return self._setpoint(0.0, 0.0)

    def hold_request(self) -> CommandLong:
        """Give the command that asks for HOLD."""
        return self._mode_request(self._persona.hold_mode)

    def _arm_next(self, *, may_arm: bool, now: float) -> None:
        """In our mode: clear what setpoint there was, then see to arming."""
        self._send_setpoint(0.0, 0.0)
        self.phase = Phase.ASKING_ARM
        if not self._armed and may_arm:
            self.we_armed = True
            self._sender.request(
                self._command(MavCmd.COMPONENT_ARM_DISARM, 1.0),
                now=now,
                give_up_after=self._watch.ask_vehicle,
            )

    def _end_release(self, *, disarm: bool, now: float) -> None:
        if disarm and self.we_armed and self._armed:
            self.phase = Phase.DISARMING
            self._sender.request(
                self._command(MavCmd.COMPONENT_ARM_DISARM, 0.0),
                now=now,
                give_up_after=self._watch.ask_vehicle,
                urgent=True,
            )
        else:
            self.phase = Phase.IDLE

    def _request_hold(self, *, now: float, again_after: float) -> None:
        self._hold_asked_at = now
        self._next_hold_at = now + again_after
        self._request_mode(self._persona.hold_mode, now=now, urgent=True)

    def _request_mode(self, mode: int, *, now: float, urgent: bool = False) -> None:
        self._sender.request(
            self._mode_request(mode),
            now=now,
            give_up_after=self._watch.ask_vehicle,
            urgent=urgent,
        )

    def _withdraw_requests(self) -> None:
        self._withdraw(MavCmd.DO_SET_MODE)
        self._withdraw(MavCmd.COMPONENT_ARM_DISARM)

    def _withdraw(self, command: MavCmd) -> None:
        self._sender.withdraw(self._target.component_id, command)

    def _mode_request(self, mode: int) -> CommandLong:
        return self._command(MavCmd.DO_SET_MODE, float(MavModeFlag.CUSTOM_MODE_ENABLED), mode)

    def _command(self, command: MavCmd, param1: float, param2: float = 0.0) -> CommandLong:
        system, component = self._target
        return CommandLong(system, component, command, 0, param1, param2, 0, 0, 0, 0, 0)

    def _send_setpoint(self, forward: float, yaw_rate: float) -> None:
        self._outgoing.append(self._setpoint(forward, yaw_rate))

    def _setpoint(self, forward: float, yaw_rate: float) -> SetPositionTargetLocalNed:
        system, component = self._target
        return SetPositionTargetLocalNed(
            time_boot_ms=0,
            target_system=system,
            target_component=component,
            coordinate_frame=self._persona.setpoint_frame,
            type_mask=self._persona.setpoint_mask,
            x=0.0,
            y=0.0,
            z=0.0,
            vx=forward,
            vy=0.0,
            vz=0.0,
            afx=0.0,
            afy=0.0,
            afz=0.0,
            yaw=0.0,
            yaw_rate=yaw_rate,
        )


def is_request_of(answer: Answered) -> bool:
    """Whether an answer belongs to a mode or arm request of ours."""
    return answer.origin is None and answer.command in (
        MavCmd.DO_SET_MODE,
        MavCmd.COMPONENT_ARM_DISARM,
    )
