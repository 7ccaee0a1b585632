"""Taking control of an ArduPilot rover, handing it back, stopping it: what is sent, in order."""

from math import inf, nan

import pytest

from mav_tasks.mavlink.enums import MavCmd, MavResult
from mav_tasks.services.offboard import Refused
from mav_tasks.services.orders import Speeds
from mav_tasks.services.persona import ARDUPILOT
from mav_tasks.services.phase import Phase
from mav_tasks.settings import Watch
from tests.unit.services.control_rig import PERIOD, Rig

HOLD, GUIDED, MANUAL = ARDUPILOT.hold_mode, ARDUPILOT.control_mode, 0
ASK_FOR = Watch().ask_vehicle  # s


class TestTakingControl:
    def test_is_mode_then_zero_then_arm_then_zeros_and_only_then_motion(self) -> None:
        rig = Rig()
        for _ in range(3):
            rig.take()
            rig.drive(0.5)
            rig.tick()
        assert rig.story() == ["our mode"]

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

    @pytest.mark.parametrize("mode", [HOLD, GUIDED])
    def test_waits_for_a_heartbeat_that_shows_whose_it_is_now(self, mode: int) -> None:
        rig = Rig(mode=mode, armed=True)
        rig.now += 1.0
        for _ in range(10):
            rig.take()
            rig.tick()
        assert (rig.phase, rig.story()) == (Phase.LOOKING, [])
        rig.hear()
        rig.take()
        assert rig.story() == (["our mode"] if mode == HOLD else ["zero"])

    def test_believes_no_heartbeat_that_had_lain_unread(self) -> None:
        rig = Rig()
        rig.control.outdated(until=rig.now + 1.0)
        rig.take()
        rig.hear()
        rig.take()
        assert (rig.phase, rig.story()) == (Phase.LOOKING, [])
        rig.now += 1.0
        rig.hear()
        rig.take()
        assert rig.story() == ["our mode"]

    def test_that_is_not_wanted_any_more_asks_nothing_of_it(self) -> None:
        rig = Rig()
        rig.now += 1.0
        rig.take()
        rig.release()
        assert (rig.phase, rig.story()) == (Phase.IDLE, [])

    def test_while_it_is_handed_back_keeps_it_standing_meanwhile(self) -> None:
        rig = Rig().in_control()
        rig.release()
        rig.story()
        rig.now += 1.0
        rig.take()
        assert (rig.phase, rig.story()) == (Phase.LOOKING, ["zero"])
        rig.release()
        assert (rig.phase, rig.story()) == (Phase.RELEASING, ["zero", "HOLD"])

    def test_believes_the_heartbeat_not_the_ack(self) -> None:
        rig = Rig()
        rig.take()
        rig.answer(MavCmd.DO_SET_MODE, MavResult.ACCEPTED)
        rig.tick()
        rig.take()
        rig.drive(0.5)
        assert rig.phase is Phase.ASKING_MODE
        assert rig.story() == ["our mode"]

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
            rig.hear()
            rig.tick()
        assert rig.control.refused is refused
        assert ASK_FOR <= rig.now - start <= ASK_FOR + 4 * PERIOD
        assert "velocity" not in " ".join(rig.story())

    @pytest.mark.parametrize(("mode", "asks"), [(HOLD, "our mode"), (GUIDED, "arm")])
    def test_asks_again_only_once_a_heartbeat_shows_that_nobody_has_acted(
        self, mode: int, asks: str
    ) -> None:
        rig = Rig(mode=mode)
        rig.now += 0.1  # that its first heartbeat comes before what is looked for
        rig.take()
        assert not rig.control.takes_heartbeat()
        for _ in range(round(3 * ASK_FOR / PERIOD)):
            rig.take()
            rig.tick()
            assert rig.refused is None, "silence is no answer yet"
        assert rig.sent.count(asks) == 1, "a person may have taken it since"
        assert [rig.control.takes_heartbeat() for _ in range(2)] == [True, False]
        rig.hear()
        rig.take()
        assert rig.sent.count(asks) == 2

    def test_a_person_seen_before_the_mode_is_asked_for_again_keeps_it(self) -> None:
        rig = Rig(mode=HOLD, armed=True)
        rig.take()
        for _ in range(8):
            rig.take()
            rig.tick()
        rig.hear(mode=MANUAL)
        assert not rig.control.may_have_set(MANUAL, now=rig.now)
        rig.control.lose()
        for _ in range(round(2 * ASK_FOR / PERIOD)):
            rig.tick()
        assert rig.story() == ["our mode"]

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
        assert rig.story() == ["our mode"]


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
        assert rig.story() == ["zero", "HOLD"]
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
        assert rig.story() == ["zero", "HOLD"]
        assert rig.phase is Phase.IDLE

    def test_without_the_wish_to_disarm_it_stays_armed(self) -> None:
        rig = Rig().in_control()
        rig.release(disarm=False)
        rig.hear(mode=HOLD)
        rig.release(disarm=False)
        assert rig.story() == ["zero", "HOLD"]
        assert (rig.phase, rig.control.we_armed) == (Phase.IDLE, True)

    def test_goes_on_until_hold_is_seen(self) -> None:
        rig = Rig().in_control()
        for _ in range(40):
            rig.release()
            rig.tick()
        assert rig.phase is Phase.RELEASING
        assert "HOLD" in rig.story()


class TestStopping:
    def test_is_zero_and_hold_in_the_same_step(self) -> None:
        rig = Rig().in_control()
        rig.control.begin_stop(now=rig.now)
        rig.collect()
        assert rig.story() == ["zero", "HOLD"]

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
        assert rig.sent.count("HOLD") >= 4
        assert rig.sent.count("zero") >= 2.0 / PERIOD

    def test_to_a_silent_rover_hold_is_the_first_of_each_pair(self) -> None:
        rig = Rig().in_control()
        rig.control.begin_stop(now=rig.now)
        rig.collect()
        rig.sent.clear()
        for _ in range(round(2.0 / PERIOD)):
            rig.stop(heard=False)
            rig.tick()
        assert 0 < rig.sent.count("zero") <= rig.sent.count("HOLD")
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
    rig.control.drive(Speeds(0.5, 0.0))
    rig.control.lose()
    rig.tick()
    assert rig.story() == []
