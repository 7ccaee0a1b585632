"""Modes and arming, as clients and as the operator at the vehicle see them."""

import math
from functools import partial

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavResult
from rover_sim.body import Pose
from rover_sim.faults import Faults
from rover_sim.personas import Mode
from tests.unit.rover_sim.rig import (
    AUTO,
    CLIENT,
    GUIDED,
    HOLD,
    INITIALISING,
    MANUAL,
    RTL,
    Rig,
    body_velocity,
    heartbeat,
    velocity,
)


def near(rig: Rig, place: tuple[float, float]) -> bool:
    return math.dist(place, (rig.truth.north, rig.truth.east)) < 0.4


def test_it_starts_initialising_and_goes_to_manual() -> None:
    rig = Rig()
    seen = [(h.custom_mode, h.type, h.autopilot) for h in rig.take(m.Heartbeat)]
    assert seen[0] == (INITIALISING, 10, 3)
    assert seen[-1] == (MANUAL, 10, 3)


@pytest.mark.parametrize("mode", [MANUAL, HOLD, AUTO, RTL, GUIDED])
def test_every_mode_may_be_entered_disarmed(mode: int) -> None:
    rig = Rig()
    assert rig.set_mode(mode) == MavResult.ACCEPTED
    rig.run(1.1)
    assert rig.last(m.Heartbeat).custom_mode == mode


def test_a_mode_change_is_shown_at_once_right_after_its_answer() -> None:
    rig = Rig()
    rig.heard.clear()
    rig.set_mode(GUIDED)
    assert [type(message) for message in rig.heard] == [m.CommandAck, m.Heartbeat]
    assert rig.last(m.Heartbeat).custom_mode == GUIDED


def test_an_unknown_mode_fails_with_a_text() -> None:
    rig = Rig()
    assert rig.set_mode(99) == MavResult.FAILED
    assert rig.texts()[-1] == "No such mode 99"


def test_mode_by_command_int_and_by_the_set_mode_message() -> None:
    rig = Rig()
    rig.send(m.CommandInt(1, 1, 0, 176, 0, 0, 1.0, HOLD, 0.0, 0.0, 0, 0, 0.0))
    assert rig.last(m.CommandAck).result == MavResult.ACCEPTED
    assert rig.last(m.Heartbeat).custom_mode == HOLD
    rig.send(m.SetMode(1, 1, GUIDED))
    assert rig.last(m.Heartbeat).custom_mode == GUIDED
    assert rig.last(m.CommandAck).command == 11  # ArduPilot answers it as a command of that id


def test_arming_too_early_is_refused_with_the_reason() -> None:
    rig = Rig(wait=0.3)
    assert rig.arm() == MavResult.FAILED
    assert rig.texts()[-1] == "Arm: AHRS: not using configured AHRS type"
    rig.run(1.0)
    assert rig.arm() == MavResult.ACCEPTED


@pytest.mark.parametrize("magic", [2989, 21196])
def test_forced_arming_skips_the_checks(magic: int) -> None:
    rig = Rig(wait=0.3)
    assert rig.command(MavCmd.COMPONENT_ARM_DISARM, 1, magic) == MavResult.ACCEPTED
    assert rig.autopilot.armed


def test_arming_is_shown_at_once() -> None:
    rig = Rig()
    rig.arm()
    assert rig.last(m.Heartbeat).base_mode & 128
    rig.command(MavCmd.COMPONENT_ARM_DISARM, 0)
    assert not rig.last(m.Heartbeat).base_mode & 128


def test_disarming_while_driving_is_accepted_and_the_rover_coasts() -> None:
    rig = Rig()
    rig.ready_to_drive()
    rig.run(3.0, velocity(1.3))
    assert rig.command(MavCmd.COMPONENT_ARM_DISARM, 0) == MavResult.ACCEPTED
    rig.run(0.2, velocity(1.3))
    assert 0.4 < rig.truth.forward_speed < 1.2
    rig.run(3.0, velocity(1.3))
    assert rig.truth.forward_speed == 0.0


def test_hold_stops_in_about_three_seconds() -> None:
    rig = Rig()
    rig.ready_to_drive()
    rig.run(4.0, velocity(2.1))
    rig.set_mode(HOLD)
    assert 2.5 < rig.until(lambda: rig.truth.forward_speed == 0.0, limit=5.0) < 3.5


def test_auto_drives_the_built_in_square_when_armed() -> None:
    rig = Rig()
    rig.set_mode(AUTO)
    rig.run(2.0)
    assert rig.truth.forward_speed == 0.0
    rig.arm()
    for corner in ((4.0, 0.0), (4.0, 4.0), (0.0, 4.0), (0.0, 0.0)):
        rig.until(partial(near, rig, corner), limit=10.0)


@pytest.mark.parametrize("mode", [AUTO, RTL])
def test_zero_setpoints_do_nothing_in_auto_and_rtl(mode: int) -> None:
    rig = Rig()
    rig.ready_to_drive()
    rig.run(8.0, velocity(2.0))
    rig.set_mode(mode)
    rig.run(1.0, body_velocity(0.0))
    before = rig.truth
    rig.run(3.0, body_velocity(0.0))
    assert math.dist((before.north, before.east), (rig.truth.north, rig.truth.east)) > 1.0
    assert rig.last(m.Heartbeat).custom_mode == mode


def test_rtl_drives_home_and_stops() -> None:
    rig = Rig(start=Pose(north=5.0, east=-3.0))
    rig.ready_to_drive()
    rig.run(6.0, velocity(1.0, 1.0))
    rig.set_mode(RTL)
    rig.run(20.0)
    assert math.dist((5.0, -3.0), (rig.truth.north, rig.truth.east)) < 0.4
    assert rig.truth.forward_speed == 0.0


def test_mission_start_enters_auto_disarmed_but_not_from_item_1() -> None:
    rig = Rig()
    assert rig.command(MavCmd.MISSION_START, 1) == MavResult.DENIED
    assert rig.command(MavCmd.MISSION_START) == MavResult.ACCEPTED
    assert rig.last(m.Heartbeat).custom_mode == AUTO


def test_return_to_launch_disarmed_is_accepted() -> None:
    rig = Rig()
    assert rig.command(MavCmd.NAV_RETURN_TO_LAUNCH) == MavResult.ACCEPTED
    assert rig.last(m.Heartbeat).custom_mode == RTL


def test_the_operator_acts_at_the_vehicle_and_clients_see_it_at_once() -> None:
    rig = Rig()
    rig.ready_to_drive()
    rig.run(2.0, velocity(1.0))
    rig.autopilot.operator_mode(Mode.MANUAL, now=rig.now)
    rig.autopilot.operator_sticks(-0.5, 0.2)
    rig.run(2.0, velocity(1.0))
    assert rig.truth.forward_speed == pytest.approx(-0.5, abs=0.1)
    assert rig.last(m.Heartbeat).custom_mode == MANUAL
    rig.autopilot.operator_arm(False, now=rig.now)
    rig.run(0.05)
    assert not rig.last(m.Heartbeat).base_mode & 128


def test_refusals_by_fault_switch() -> None:
    rig = Rig()
    rig.autopilot.set_faults(Faults(refuse_arm=True, refuse_mode=True))
    assert rig.set_mode(GUIDED) == MavResult.FAILED
    assert rig.command(MavCmd.COMPONENT_ARM_DISARM, 1, 21196) == MavResult.FAILED
    rig.autopilot.set_faults(Faults())
    rig.ready_to_drive()


def test_a_reboot_starts_time_and_state_anew_after_a_silence() -> None:
    rig = Rig()
    rig.ready_to_drive()
    assert rig.command(MavCmd.PREFLIGHT_REBOOT_SHUTDOWN, 1) == MavResult.FAILED  # armed
    rig.command(MavCmd.COMPONENT_ARM_DISARM, 0)
    rig.command(MavCmd.SET_MESSAGE_INTERVAL, m.Attitude.id, 50_000)
    rig.run(1.0)
    assert rig.command(MavCmd.PREFLIGHT_REBOOT_SHUTDOWN, 1) == MavResult.ACCEPTED
    rig.heard.clear()
    rig.run(0.9)
    assert rig.heard == []
    rig.run(2.0)
    assert rig.take(m.Attitude)[0].time_boot_ms < 100
    assert not rig.autopilot.armed
    rig.run(4.0)
    assert len(rig.take(m.Attitude)) == 4  # and streams are at their defaults again


OPERATOR = CLIENT._replace(system_id=255)  # the rig's own heartbeats are another system's


def heard_operator_then_nothing(*, enabled: int, seconds: float) -> Rig:
    rig = Rig()
    rig.autopilot.parameters["FS_GCS_ENABLE"] = enabled
    rig.ready_to_drive()
    rig.send_from(OPERATOR, heartbeat())
    rig.run(seconds, velocity(1.0))
    return rig


def test_the_operator_lost_failsafe_is_off_by_default() -> None:
    rig = heard_operator_then_nothing(enabled=0, seconds=6.0)
    assert rig.autopilot.mode is Mode.GUIDED


def test_when_on_it_holds_after_three_and_a_half_seconds_without_the_operator() -> None:
    rig = heard_operator_then_nothing(enabled=1, seconds=3.4)
    assert rig.autopilot.mode is Mode.GUIDED
    rig.run(0.3, velocity(1.0))
    assert "Radio Failsafe" in rig.texts()
    assert rig.last(m.Heartbeat).custom_mode == HOLD
    assert rig.last(m.Heartbeat).system_status == 5


def test_it_clears_with_the_next_heartbeat_but_the_mode_stays_hold() -> None:
    rig = heard_operator_then_nothing(enabled=1, seconds=4.0)
    rig.send_from(OPERATOR, heartbeat())
    rig.run(0.1)
    assert "GCS Failsafe Cleared" in rig.texts()
    assert rig.autopilot.mode is Mode.HOLD
