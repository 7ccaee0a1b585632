"""Modes, arming and commands of an ArduPilot, as clients and somebody at the vehicle see them."""

import math

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavResult
from rover_sim.errors import SimulatedCrash
from rover_sim.geo import DEFAULT_ORIGIN
from rover_sim.personas import Mode
from tests.unit.rover_sim.rig import (
    CLIENT,
    GUIDED,
    HOLD,
    MANUAL,
    Rig,
    heartbeat,
    velocity,
)


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


def test_when_on_it_holds_after_three_and_a_half_seconds_without_the_operator() -> None:
    rig = Rig()
    rig.autopilot.parameters["FS_GCS_ENABLE"] = 1
    rig.ready_to_drive()
    rig.send_from(CLIENT._replace(system_id=255), heartbeat())  # the rig's own is another system
    rig.run(3.4, velocity(1.0))
    assert rig.autopilot.mode is Mode.GUIDED
    rig.run(0.3, velocity(1.0))
    assert "Radio Failsafe" in rig.texts()
    seen = rig.last(m.Heartbeat)
    assert (seen.custom_mode, seen.system_status) == (HOLD, 5)


def test_reposition_changes_to_guided_and_drives_there() -> None:
    rig = Rig()
    rig.arm()
    x, y = DEFAULT_ORIGIN.to_global(4.0, 2.0)
    result = rig.command_int(MavCmd.DO_REPOSITION, frame=6, x=x, y=y, param2=1)
    assert result == MavResult.ACCEPTED
    assert rig.last(m.Heartbeat).custom_mode == GUIDED
    rig.run(12.0)
    assert (rig.truth.north, rig.truth.east) == pytest.approx((4.0, 2.0), abs=0.15)
    assert [reached.seq for reached in rig.take(m.MissionItemReached)] == [0]


def test_nan_speed_crashes_as_the_real_one() -> None:
    rig = Rig()
    with pytest.raises(SimulatedCrash):
        rig.command(MavCmd.DO_CHANGE_SPEED, 1, math.nan)
