"""Control of PX4 and generic rovers: the order of the steps, and what STOP is made of."""

from math import atan2, cos, hypot, pi, sin

import pytest

from mav_tasks.mavlink.enums import MavCmd, MavResult
from mav_tasks.mavlink.messages import SetPositionTargetLocalNed
from mav_tasks.services.news import AWAITED
from mav_tasks.services.offboard import LEAD_IN, UNSTOPPED, Refused
from mav_tasks.services.orders import STANDING, Posture, Speeds, moves
from mav_tasks.services.persona import GENERIC, PX4, Persona
from mav_tasks.services.phase import Phase
from mav_tasks.settings import Watch
from tests.unit.services.control_rig import PERIOD, Rig

HOLD, OFFBOARD = PX4.hold_mode, PX4.control_mode
MISSION = PX4.mission_mode
ASK_FOR = Watch().ask_vehicle  # s
FLT_EPSILON = 1.1920929e-7  # m/s; PX4's speed loop is off below

both = pytest.mark.parametrize("persona", [PX4, GENERIC], ids=str)


def ticks(rig: Rig, seconds: float) -> None:
    """Let time pass while control is being taken, with heartbeats that say nothing new."""
    for number in range(round(seconds / PERIOD)):
        if number % 10 == 9:
            rig.hear()
        rig.take()
        rig.tick()
        if rig.sent[-1:] == ["stay"]:
            rig.answer(MavCmd.DO_REPOSITION, MavResult.ACCEPTED)


def armed_in_hold(persona: Persona = PX4) -> Rig:
    """A rover that has just shown that it is armed, at our request."""
    rig = Rig(persona)
    rig.take()
    rig.answer(MavCmd.DO_SET_MODE, MavResult.ACCEPTED)
    rig.take()
    rig.answer(MavCmd.COMPONENT_ARM_DISARM, MavResult.ACCEPTED)
    rig.hear(armed=True)
    return rig


def in_control(persona: Persona = PX4) -> Rig:
    """A rover that takes motion; the story begins there."""
    rig = armed_in_hold(persona)
    ticks(rig, LEAD_IN + 3 * PERIOD)
    rig.answer(MavCmd.DO_SET_MODE, MavResult.ACCEPTED)
    rig.hear(mode=OFFBOARD)
    rig.take()
    assert rig.control.in_control
    rig.story()
    return rig


class TestStanding:
    """Zero velocity is a course to the north for it; next to none along its heading is to stand."""

    @pytest.mark.parametrize("yaw", [0.0, 2.5, -pi])
    def test_is_asked_for_along_the_heading(self, yaw: float) -> None:
        rig = in_control()
        rig.control.posture = Posture(yaw)
        rig.control.drive(STANDING)
        [setpoint] = rig.control.take_messages()
        assert isinstance(setpoint, SetPositionTargetLocalNed)
        assert atan2(setpoint.vy, setpoint.vx) == pytest.approx(yaw)
        assert 0.0 < hypot(setpoint.vx, setpoint.vy) < FLT_EPSILON

    def test_is_one_millimetre_a_second_while_it_rolls_so_that_its_speed_loop_brakes(self) -> None:
        rig = in_control()
        rig.control.posture = Posture(1.0, rolls=True)
        rig.control.drive(STANDING)
        [setpoint] = rig.control.take_messages()
        assert isinstance(setpoint, SetPositionTargetLocalNed)
        assert (setpoint.vx, setpoint.vy) == pytest.approx((1e-3 * cos(1.0), 1e-3 * sin(1.0)))
        assert not moves(setpoint)

    def test_is_plain_zero_for_one_that_is_not_armed_or_whose_heading_is_not_known(self) -> None:
        for rig, yaw in ((Rig(PX4), 1.0), (in_control(), None)):
            rig.control.posture = Posture(yaw)
            setpoint = rig.control.zero_setpoint()
            assert (setpoint.vx, setpoint.vy, setpoint.yaw_rate) == (0.0, 0.0, 0.0)

    def test_a_course_without_a_speed_is_a_turn_on_the_spot(self) -> None:
        rig = in_control()
        rig.control.posture = Posture(0.0)
        rig.control.drive(Speeds(0.0, course=pi / 2))
        [setpoint] = rig.control.take_messages()
        assert isinstance(setpoint, SetPositionTargetLocalNed)
        assert atan2(setpoint.vy, setpoint.vx) == pytest.approx(pi / 2)
        assert 0.0 < hypot(setpoint.vx, setpoint.vy) < FLT_EPSILON

    def test_it_may_come_late_and_motion_may_not(self) -> None:
        rig = in_control()
        rig.control.posture = Posture(1.0)
        assert not moves(rig.control.zero_setpoint())


class TestTakingControl:
    @both
    def test_is_hold_then_arm_then_a_second_of_zeros_then_offboard(self, persona: Persona) -> None:
        rig = Rig(persona)
        rig.take()
        assert rig.story() == ["HOLD"], "asked for, though it is shown"
        rig.answer(MavCmd.DO_SET_MODE, MavResult.ACCEPTED)
        ticks(rig, 0.2)
        assert rig.story() == ["zero", "arm", "zero"]
        rig.hear(armed=True)
        rig.take()
        rig.answer(MavCmd.DO_REPOSITION, MavResult.ACCEPTED)
        assert rig.story() == ["zero", "stay"], "or it drives to where it was held before"
        ticks(rig, LEAD_IN)
        assert rig.story() == ["zero"], "not in our mode before the stream has lasted"
        ticks(rig, 2 * PERIOD)
        assert rig.story() == ["zero", "our mode", "zero"]
        assert not rig.control.in_control
        rig.hear(mode=OFFBOARD)
        rig.take()
        assert rig.control.in_control
        assert rig.story() == ["zero"]
        rig.drive(0.5, course=pi / 2)
        assert rig.story() == ["north 0.00 east 0.50"]

    def test_hold_that_was_not_shown_before_is_believed_when_a_heartbeat_shows_it(self) -> None:
        rig = Rig(PX4, mode=MISSION)
        rig.take()
        rig.answer(MavCmd.DO_SET_MODE, MavResult.ACCEPTED)
        ticks(rig, 0.2)
        assert rig.story() == ["HOLD"]
        rig.hear(mode=HOLD)
        rig.take()
        assert rig.story() == ["zero", "arm"]

    def test_hold_that_was_shown_before_is_believed_only_when_it_is_answered(self) -> None:
        rig = Rig(PX4)
        ticks(rig, 0.9)
        assert rig.story() == ["HOLD"], "a failsafe's looks the same"
        rig.answer(MavCmd.DO_SET_MODE, MavResult.ACCEPTED)
        rig.take()
        assert rig.story() == ["zero", "arm"]

    def test_a_heartbeat_just_after_the_answer_may_still_show_the_mode_before(self) -> None:
        """PX4 answers HOLD, and the heartbeat that it is asked for still says OFFBOARD."""
        rig = in_control()
        rig.release()
        rig.answer(MavCmd.DO_SET_MODE, MavResult.ACCEPTED)
        rig.control.heard(armed=True, mode=OFFBOARD, now=rig.now + 0.02)
        rig.take()
        assert not rig.control.in_control, "the next task does not begin on it"
        rig.hear(mode=HOLD)
        ticks(rig, LEAD_IN + 3 * PERIOD)
        assert "our mode" in rig.story()

    def test_our_mode_is_not_asked_for_on_old_news(self) -> None:
        rig = armed_in_hold()
        for _ in range(60):  # nothing is heard for three seconds
            rig.take()
            rig.tick()
        assert "our mode" not in rig.story()
        rig.hear()
        rig.take()
        assert "our mode" in rig.story()

    def test_after_a_gap_the_second_of_zeros_begins_anew(self) -> None:
        rig = armed_in_hold()
        ticks(rig, 0.6)
        rig.now += 0.4
        rig.story()
        ticks(rig, 0.9)
        assert rig.story() == ["zero"]
        ticks(rig, 0.2)
        assert rig.story() == ["zero"], "a heartbeat is to show first whose it is now"
        rig.hear()
        ticks(rig, 0.1)
        assert "our mode" in rig.story()

    def test_one_that_is_armed_in_our_mode_is_in_control_at_once(self) -> None:
        rig = Rig(PX4, armed=True, mode=OFFBOARD)
        rig.take()
        assert (rig.story(), rig.control.in_control) == (["zero"], True)

    def test_one_in_our_mode_that_is_not_armed_goes_by_way_of_hold(self) -> None:
        rig = Rig(PX4, mode=OFFBOARD)
        rig.take()
        assert rig.story() == ["HOLD"]

    def test_an_armed_one_is_not_armed_again(self) -> None:
        rig = Rig(PX4, armed=True)
        rig.take()
        rig.answer(MavCmd.DO_SET_MODE, MavResult.ACCEPTED)
        ticks(rig, LEAD_IN + 3 * PERIOD)
        assert rig.story() == ["HOLD", "zero", "stay", "zero", "our mode", "zero"]
        assert not rig.control.we_armed

    @pytest.mark.parametrize("mode", [HOLD, MISSION])
    def test_hold_refused_for_a_second_is_an_answer(self, mode: int) -> None:
        rig = Rig(PX4, mode=mode)
        for _ in range(round(1.5 * ASK_FOR / PERIOD)):
            rig.take()
            rig.answer(MavCmd.DO_SET_MODE, MavResult.TEMPORARILY_REJECTED)
            rig.tick()
            if rig.refused is not None:
                break
        assert rig.refused is Refused.MODE
        assert rig.story() == ["HOLD"]

    def test_offboard_refused_is_asked_for_again_while_zeros_stream(self) -> None:
        rig = armed_in_hold()
        ticks(rig, LEAD_IN + 2 * PERIOD)
        rig.story()
        for _ in range(10):
            rig.answer(MavCmd.DO_SET_MODE, MavResult.TEMPORARILY_REJECTED)
            rig.hear()
            ticks(rig, PERIOD)
        assert rig.story() == ["zero", "our mode", "zero"]

    def test_where_the_zeros_had_ended_it_begins_anew(self) -> None:
        rig = armed_in_hold()
        ticks(rig, LEAD_IN + 2 * PERIOD)
        rig.story()
        rig.now += 0.4  # the server stood still
        ticks(rig, LEAD_IN - PERIOD)
        assert rig.story() == ["zero", "stay", "HOLD"], "what was asked for may come yet"
        rig.answer(MavCmd.DO_SET_MODE, MavResult.ACCEPTED)
        ticks(rig, LEAD_IN - PERIOD)
        assert rig.story() == ["zero", "stay", "zero"]
        ticks(rig, 2 * PERIOD)
        rig.hear()
        ticks(rig, 2 * PERIOD)
        assert rig.story() == ["zero", "our mode", "zero"]

    @pytest.mark.parametrize("speed", [0.5, -0.5])
    def test_no_motion_before_control(self, speed: float) -> None:
        rig = Rig(PX4)
        for _ in range(60):
            rig.take()
            rig.answer(MavCmd.DO_SET_MODE, MavResult.ACCEPTED)
            rig.drive(speed, course=0.0)
            rig.tick()
        assert set(rig.story()) == {"HOLD", "zero", "arm"}


class TestMotion:
    def test_is_a_vector_over_ground(self) -> None:
        rig = in_control()
        rig.drive(1.0, 0.3, course=-pi / 4)
        assert rig.story() == ["north 0.71 east -0.71"]

    @pytest.mark.parametrize(("speed", "course"), [(0.5, None), (-0.5, 0.0), (0.0, 1.0)])
    def test_what_cannot_be_said_so_is_a_zero(self, speed: float, course: float | None) -> None:
        rig = in_control()
        rig.drive(speed, 0.5, course)
        assert rig.story() == ["zero"]


class TestHandingBack:
    @both
    def test_is_zeros_then_hold_then_disarming(self, persona: Persona) -> None:
        rig = in_control(persona)
        rig.release()
        assert rig.story() == ["zero", "HOLD"]
        rig.hear(mode=HOLD)
        rig.release()
        assert rig.story() == ["disarm"]
        rig.hear(armed=False)
        rig.release()
        assert (rig.story(), rig.phase) == ([], Phase.IDLE)

    @pytest.mark.parametrize("steps", range(4))
    def test_at_whatever_step_of_taking_ends_in_hold(self, steps: int) -> None:
        rig = Rig(PX4)
        if steps:
            rig = armed_in_hold()
            ticks(rig, (steps - 1) * LEAD_IN)
        else:
            rig.take()
        rig.release()
        for _ in range(3):
            rig.release()
            rig.tick()
        assert "HOLD" in rig.story()
        rig.answer(MavCmd.DO_SET_MODE, MavResult.ACCEPTED)
        rig.hear(mode=HOLD)
        rig.release()
        assert rig.phase in (Phase.IDLE, Phase.DISARMING)


class TestStop:
    def test_ends_also_what_is_driven_in_hold(self) -> None:
        rig = Rig(PX4, armed=True)
        rig.control.begin_stop(now=rig.now)
        rig.collect()
        assert sorted(rig.story()) == ["HOLD", "stay", "zero"]

    def test_of_one_in_another_mode_is_zero_and_hold(self) -> None:
        rig = in_control()
        rig.control.begin_stop(now=rig.now)
        rig.collect()
        assert sorted(rig.story()) == ["HOLD", "zero"]

    def stop_for(self, rig: Rig, seconds: float) -> list[str]:
        rig.control.begin_stop(now=rig.now)
        for _ in range(round(seconds / PERIOD)):
            rig.stop()
            rig.tick()
            rig.hear()
        return rig.story()

    def test_disarms_a_generic_one_whose_hold_is_not_seen_within_a_second(self) -> None:
        rig = in_control(GENERIC)
        assert "disarm" not in self.stop_for(rig, UNSTOPPED)
        for _ in range(round((AWAITED - UNSTOPPED) / PERIOD) + 10):
            rig.stop()
            rig.tick()
            rig.hear()
        assert "disarm" in rig.story()
        rig.hear(armed=False)
        rig.stop(still=True)
        assert rig.phase is Phase.IDLE, "disarmed and standing is stopped"

    def test_disarms_no_other(self) -> None:
        rig = in_control(PX4)
        assert "disarm" not in self.stop_for(rig, 5.0)
        rig.hear(armed=False)
        rig.stop(still=True)
        assert rig.phase is Phase.STOPPING

    def test_does_not_disarm_a_generic_one_in_hold_that_still_rolls(self) -> None:
        rig = in_control(GENERIC)
        rig.control.begin_stop(now=rig.now)
        rig.hear(mode=HOLD)
        for _ in range(60):
            rig.stop()
            rig.tick()
            rig.hear()
        assert "disarm" not in rig.story()
