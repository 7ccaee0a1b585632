"""Taking control of an ArduPilot rover, handing it back, stopping it: what is sent, in order."""

from math import inf, nan

import pytest

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavResult
from mav_tasks.mavlink.messages import CommandAck, CommandLong, Message, SetPositionTargetLocalNed
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.command_sender import CommandSender
from mav_tasks.services.offboard import UNANSWERED, OffboardControl, Phase, Refused
from mav_tasks.services.persona import ARDUPILOT
from mav_tasks.settings import Watch

HOLD, GUIDED = ARDUPILOT.hold_mode, ARDUPILOT.control_mode
PERIOD = 0.05  # s
ASK_FOR = Watch().ask_vehicle  # s


class Rig:
    """Control of one rover in virtual time; ``sent`` reads as the story of what went out."""

    def __init__(self, *, armed: bool = False, mode: int = HOLD) -> None:
        self.now = 100.0
        self.sender = CommandSender(Address(250, 191))
        self.control = OffboardControl(Address(1, 1), ARDUPILOT, self.sender, Watch())
        self.armed, self.mode = armed, mode
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
        self.sent += [told(m) for m in self.control.take_messages()]
        self.sent += [told(m) for m in outgoing]
        for answer in answers:
            self.control.answered(answer, now=self.now)

    def take(self, *, may_arm: bool = True) -> None:
        self.control.take(may_arm=may_arm, now=self.now)
        self.collect()

    def drive(self, forward: float, yaw_rate: float = 0.0) -> None:
        self.control.drive(forward, yaw_rate)
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
        for now_so in ({}, {"mode": GUIDED}, {"armed": True}):
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


def told(message: Message | Packet) -> str:
    """A packet to the rover in a word."""
    if isinstance(message, SetPositionTargetLocalNed):
        assert (message.target_system, message.target_component) == (1, 1)
        assert (message.type_mask, message.coordinate_frame) == (0x05C7, 8)
        moves = message.vx or message.yaw_rate
        return f"velocity {message.vx:g} {message.yaw_rate:g}" if moves else "zero"
    assert isinstance(message, CommandLong)
    if message.command == MavCmd.DO_SET_MODE:
        return f"mode {message.param2:g}"
    assert message.command == MavCmd.COMPONENT_ARM_DISARM
    return "arm" if message.param1 == 1.0 else "disarm"


class TestTakingControl:
    def test_is_mode_then_zero_then_arm_then_zeros_and_only_then_motion(self) -> None:
        rig = Rig()
        for _ in range(3):
            rig.take()
            rig.drive(0.5)
            rig.tick()
        assert rig.story() == [f"mode {GUIDED}"]

        rig.hear(mode=GUIDED)
        for _ in range(3):
            rig.take()
            rig.drive(0.5)
            rig.tick()
        assert rig.story()[:3] == ["zero", "arm", "zero"]
        assert not rig.control.in_control

        rig.hear(armed=True)
        rig.take()
        rig.drive(0.5, -0.1)
        assert rig.story() == ["zero", "velocity 0.5 -0.1"]

    def test_believes_the_heartbeat_not_the_ack(self) -> None:
        rig = Rig()
        rig.take()
        rig.answer(MavCmd.DO_SET_MODE, MavResult.ACCEPTED)
        rig.tick()
        rig.take()
        rig.drive(0.5)
        assert rig.phase is Phase.ASKING_MODE
        assert rig.story() == [f"mode {GUIDED}"]

    def test_of_a_rover_armed_in_our_mode_needs_a_zero_first(self) -> None:
        rig = Rig(armed=True, mode=GUIDED)
        rig.take()
        assert not rig.control.in_control
        rig.take()
        rig.drive(0.5)
        assert rig.story() == ["zero", "velocity 0.5 0"]
        assert not rig.control.we_armed

    def test_does_not_arm_where_only_the_operator_may(self) -> None:
        rig = Rig(mode=GUIDED)
        for _ in range(5):
            rig.take(may_arm=False)
            rig.tick()
        assert rig.story() == ["zero"]
        rig.hear(armed=True)
        rig.take(may_arm=False)
        assert (rig.control.in_control, rig.control.we_armed) == (True, False)

    @pytest.mark.parametrize(
        ("mode", "command", "refused"),
        [
            (HOLD, MavCmd.DO_SET_MODE, Refused.MODE),
            (GUIDED, MavCmd.COMPONENT_ARM_DISARM, Refused.ARM),
        ],
    )
    @pytest.mark.parametrize("result", [MavResult.DENIED, MavResult.FAILED, None])
    def test_asks_for_a_second_and_then_says_what_was_refused(
        self, mode: int, command: MavCmd, refused: Refused, result: MavResult | None
    ) -> None:
        rig = Rig(mode=mode)
        start = rig.now
        while rig.control.refused is None and rig.now < start + 5.0:
            rig.take()
            if result is not None:
                rig.answer(command, result)
            rig.tick()
        assert rig.control.refused is refused
        assert ASK_FOR <= rig.now - start <= ASK_FOR + 4 * PERIOD
        assert "velocity" not in " ".join(rig.story())

    def test_a_refusal_is_forgotten_when_control_is_wanted_again(self) -> None:
        rig = Rig()
        rig.control.refused = Refused.MODE
        rig.take()
        assert rig.refused is None
        assert rig.phase is Phase.ASKING_MODE

    def test_starts_over_when_the_mode_was_lost_meanwhile(self) -> None:
        rig = Rig().in_control()
        rig.hear(mode=HOLD)
        rig.drive(0.5)
        assert rig.story() == ["zero"]
        rig.take()
        assert rig.story() == [f"mode {GUIDED}"]


class TestDriving:
    @pytest.mark.parametrize(("forward", "yaw_rate"), [(nan, 0.0), (0.5, inf), (-inf, nan)])
    def test_a_number_that_is_not_finite_becomes_a_stop(
        self, forward: float, yaw_rate: float
    ) -> None:
        rig = Rig().in_control()
        rig.drive(forward, yaw_rate)
        assert rig.story() == ["zero"]

    def test_nothing_is_sent_to_a_rover_that_is_not_ours(self) -> None:
        rig = Rig(armed=True, mode=GUIDED)
        rig.drive(0.5)
        assert rig.story() == []

    def test_a_rover_disarmed_by_somebody_else_gets_no_motion(self) -> None:
        rig = Rig().in_control()
        rig.hear(armed=False)
        rig.drive(0.5)
        assert rig.story() == ["zero"]
        assert not rig.control.we_armed


class TestHandingBack:
    def test_is_zeros_until_it_stands_then_hold_then_disarm(self) -> None:
        rig = Rig().in_control()
        for _ in range(3):
            rig.release(still=False)
            rig.tick()
        assert rig.story() == ["zero"]
        rig.release(still=True)
        assert rig.story() == ["zero", f"mode {HOLD}"]
        rig.hear(mode=HOLD)
        rig.release()
        assert rig.story() == ["disarm"]
        rig.hear(armed=False)
        rig.release()
        rig.release()
        assert (rig.story(), rig.phase) == ([], Phase.IDLE)

    def test_leaves_a_rover_armed_that_somebody_else_armed(self) -> None:
        rig = Rig(armed=True, mode=GUIDED).in_control()
        rig.release()
        rig.hear(mode=HOLD)
        rig.release()
        assert rig.story() == ["zero", f"mode {HOLD}"]
        assert rig.phase is Phase.IDLE

    def test_without_the_wish_to_disarm_it_stays_armed(self) -> None:
        rig = Rig().in_control()
        rig.release(disarm=False)
        rig.hear(mode=HOLD)
        rig.release(disarm=False)
        assert rig.story() == ["zero", f"mode {HOLD}"]
        assert (rig.phase, rig.control.we_armed) == (Phase.IDLE, True)

    def test_goes_on_until_hold_is_seen(self) -> None:
        rig = Rig().in_control()
        for _ in range(40):
            rig.release()
            rig.tick()
        assert rig.phase is Phase.RELEASING
        assert f"mode {HOLD}" in rig.story()


class TestStopping:
    def test_is_zero_and_hold_in_the_same_step(self) -> None:
        rig = Rig().in_control()
        rig.control.begin_stop(now=rig.now)
        rig.collect()
        assert rig.story() == ["zero", f"mode {HOLD}"]

    def test_calls_off_arming(self) -> None:
        rig = Rig(mode=GUIDED)
        rig.take()
        assert rig.story() == ["zero", "arm"]
        rig.control.begin_stop(now=rig.now)
        for _ in range(60):
            rig.stop()
            rig.tick()
        assert "arm" not in rig.story()

    def test_goes_on_until_hold_is_seen_and_the_rover_stands(self) -> None:
        rig = Rig(armed=True, mode=GUIDED).in_control()
        rig.control.begin_stop(now=rig.now)
        for _ in range(30):
            rig.stop(still=True)
            rig.tick()
        assert rig.phase is Phase.STOPPING
        rig.hear(mode=HOLD)
        phases = []
        for still in (False, True):
            rig.stop(still=still)
            phases.append(rig.phase)
        assert phases == [Phase.STOPPING, Phase.IDLE]

    def test_hold_is_asked_for_at_least_twice_a_second(self) -> None:
        rig = Rig().in_control()
        rig.control.begin_stop(now=rig.now)
        for _ in range(round(2.0 / PERIOD)):
            rig.stop()
            rig.tick()
        assert rig.sent.count(f"mode {HOLD}") >= 4
        assert rig.sent.count("zero") >= 2.0 / PERIOD

    def test_to_a_silent_rover_hold_is_the_first_of_each_pair(self) -> None:
        rig = Rig().in_control()
        rig.control.begin_stop(now=rig.now)
        rig.collect()
        rig.sent.clear()
        for _ in range(round(2.0 / PERIOD)):
            rig.stop(heard=False)
            rig.tick()
        assert 0 < rig.sent.count("zero") <= rig.sent.count(f"mode {HOLD}")
        assert rig.phase is Phase.STOPPING

    def test_motion_is_not_sent_while_stopping(self) -> None:
        rig = Rig().in_control()
        rig.control.begin_stop(now=rig.now)
        rig.collect()
        rig.story()
        rig.drive(0.5)
        assert rig.story() == []


def test_after_a_takeover_not_one_thing_more_is_sent() -> None:
    rig = Rig(mode=GUIDED)
    rig.take()
    rig.story()
    rig.control.lose()
    rig.drive(0.5)
    for _ in range(60):
        rig.tick()
    assert (rig.story(), rig.phase, rig.control.we_armed) == ([], Phase.IDLE, False)


def test_what_was_not_sent_yet_at_a_takeover_is_not_sent_after_it() -> None:
    rig = Rig().in_control()
    rig.control.drive(0.5, 0.0)
    rig.control.lose()
    rig.tick()
    assert rig.story() == []
