"""Control of one rover in virtual time, and what is sent in the course of it."""

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavResult
from mav_tasks.mavlink.messages import (
    CommandAck,
    CommandInt,
    CommandLong,
    Message,
    SetPositionTargetLocalNed,
)
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.command_sender import CommandSender
from mav_tasks.services.news import UNANSWERED
from mav_tasks.services.offboard import OffboardControl, Refused
from mav_tasks.services.orders import Speeds
from mav_tasks.services.persona import ARDUPILOT, Persona
from mav_tasks.services.phase import Phase
from mav_tasks.settings import Watch

PERIOD = 0.05  # s


class Rig:
    """Control of one rover in virtual time; ``sent`` reads as the story of what went out."""

    def __init__(
        self, persona: Persona = ARDUPILOT, *, armed: bool = False, mode: int | None = None
    ) -> None:
        self.now = 100.0
        self.persona = persona
        self.sender = CommandSender(Address(250, 191))
        self.control = OffboardControl(Address(1, 1), persona, self.sender, Watch())
        self.armed, self.mode = armed, persona.hold_mode if mode is None else mode
        self.sent: list[str] = []
        self.hear()

    def hear(self, *, armed: bool | None = None, mode: int | None = None) -> None:
        self.armed = self.armed if armed is None else armed
        self.mode = self.mode if mode is None else mode
        # late enough to have been sent after the last request was heard
        self.control.heard(armed=self.armed, mode=self.mode, now=self.now + UNANSWERED)

    @property
    def phase(self) -> Phase:
        return self.control.phase

    @property
    def refused(self) -> Refused | None:
        return self.control.refused

    def tick(self) -> None:
        """One setpoint period passes."""
        self.now = round(self.now + PERIOD, 6)
        self.sender.handle_deadline(now=self.now)
        self.collect()

    def collect(self) -> None:
        outgoing, answers = self.sender.take()
        self.sent += [self.told(m) for m in self.control.take_messages()]
        self.sent += [self.told(m) for m in outgoing]
        for answer in answers:
            self.control.answered(answer, now=self.now)

    def take(self, *, may_arm: bool = True) -> None:
        self.control.take(may_arm=may_arm, now=self.now)
        self.collect()

    def drive(self, forward: float, yaw_rate: float = 0.0, course: float | None = None) -> None:
        self.control.drive(Speeds(forward, yaw_rate, course))
        self.collect()

    def release(self, *, still: bool = True, disarm: bool = True) -> None:
        self.control.release(still=still, disarm=disarm, now=self.now)
        self.collect()

    def stop(self, *, still: bool = False, heard: bool = True) -> None:
        self.control.stop(still=still, heard=heard, now=self.now)
        self.collect()

    def answer(self, command: MavCmd, result: MavResult) -> None:
        self.sender.receive(CommandAck(command, result), component=1, now=self.now)
        self.collect()

    def in_control(self) -> "Rig":
        """Go all the way, and begin the story there."""
        for now_so in ({}, {"mode": self.persona.control_mode}, {"armed": True}):
            self.hear(**now_so)
            self.take()
            for command in (MavCmd.DO_SET_MODE, MavCmd.COMPONENT_ARM_DISARM):
                self.answer(command, MavResult.ACCEPTED)
            self.tick()
        assert self.control.in_control
        self.story()
        return self

    def story(self) -> list[str]:
        """What was sent since the last call, repeats of the same left out."""
        story = [what for n, what in enumerate(self.sent) if n == 0 or self.sent[n - 1] != what]
        self.sent.clear()
        return story

    def told(self, message: Message | Packet) -> str:
        """A packet to the rover in a word."""
        if isinstance(message, SetPositionTargetLocalNed):
            assert (message.target_system, message.target_component) == (1, 1)
            assert message.type_mask == self.persona.setpoint_mask
            assert message.coordinate_frame == self.persona.setpoint_frame
            if self.persona.honours_yaw_rate:
                moves = message.vx or message.yaw_rate
                return f"velocity {message.vx:g} {message.yaw_rate:g}" if moves else "zero"
            moves = abs(message.vx) >= 0.002 or abs(message.vy) >= 0.002
            return f"north {message.vx:.2f} east {message.vy:.2f}" if moves else "zero"
        if isinstance(message, CommandInt):
            assert (message.command, message.x, message.y) == (192, 0x7FFFFFFF, 0x7FFFFFFF)
            return "stay"
        assert isinstance(message, CommandLong)
        if message.command == MavCmd.DO_SET_MODE:
            assert message.param1 == 1.0
            mode = self.persona.mode_in(message.param2, message.param3)
            names = {self.persona.hold_mode: "HOLD", self.persona.control_mode: "our mode"}
            return names[mode or 0]
        assert message.command == MavCmd.COMPONENT_ARM_DISARM
        return "arm" if message.param1 == 1.0 else "disarm"
