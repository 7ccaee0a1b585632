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
    MANUAL,
    RTL,
    Rig,
    heartbeat,
    velocity,
)


def near(rig: Rig, place: tuple[float, float]) -> bool:
    return math.dist(place, (rig.truth.north, rig.truth.east)) < 0.4


def test_arming_too_early_is_refused_with_the_reason() -> None:
    rig = Rig(wait=0.3)
    assert rig.arm() == MavResult.FAILED
    assert rig.texts()[-1] == "Arm: AHRS: not using configured AHRS type"
    rig.run(1.0)
    assert rig.arm() == MavResult.ACCEPTED


def test_disarming_while_driving_is_accepted_and_the_rover_coasts() -> None:
    rig = Rig()
    rig.ready_to_drive()
    rig.run(3.0, velocity(1.3))
    assert rig.command(MavCmd.COMPONENT_ARM_DISARM, 0) == MavResult.ACCEPTED
    rig.run(0.2, velocity(1.3))
    assert 0.4 < rig.truth.forward_speed < 1.2
    rig.run(3.0, velocity(1.3))
    assert rig.truth.forward_speed == 0.0


def test_auto_drives_the_built_in_square_when_armed() -> None:
    rig = Rig()
    rig.set_mode(AUTO)
    rig.run(2.0)
    assert rig.truth.forward_speed == 0.0
    rig.arm()
    for corner in ((4.0, 0.0), (4.0, 4.0), (0.0, 4.0), (0.0, 0.0)):
        rig.until(partial(near, rig, corner), limit=10.0)


def test_rtl_drives_home_and_stops() -> None:
    rig = Rig(start=Pose(north=5.0, east=-3.0))
    rig.ready_to_drive()
    rig.run(6.0, velocity(1.0, 1.0))
    rig.set_mode(RTL)
    rig.run(20.0)
    assert math.dist((5.0, -3.0), (rig.truth.north, rig.truth.east)) < 0.4
    assert rig.truth.forward_speed == 0.0


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


def test_when_on_it_holds_after_three_and_a_half_seconds_without_the_operator() -> None:
    rig = heard_operator_then_nothing(enabled=1, seconds=3.4)
    assert rig.autopilot.mode is Mode.GUIDED
    rig.run(0.3, velocity(1.0))
    assert "Radio Failsafe" in rig.texts()
    assert rig.last(m.Heartbeat).custom_mode == HOLD
    assert rig.last(m.Heartbeat).system_status == 5
