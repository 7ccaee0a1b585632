"""The life of a setpoint in GUIDED: kept while disarmed, timed out, cleared."""

import math

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavResult
from tests.unit.rover_sim.rig import (
    GUIDED,
    HOLD,
    MANUAL,
    POSITION,
    Rig,
    body_velocity,
    heartbeat,
    local_target,
    velocity,
)

TIMEOUT_TEXT = "target not received last 3secs, stopping"


def distance_from(rig: Rig, north: float, east: float) -> float:
    return math.dist((north, east), (rig.truth.north, rig.truth.east))


def test_without_setpoints_it_drives_on_for_three_seconds_then_brakes() -> None:
    rig = Rig()
    rig.ready_to_drive()
    rig.run(4.0, velocity(2.0))
    last = rig.truth
    rig.take(m.Statustext)
    rig.until(lambda: TIMEOUT_TEXT in rig.texts(), limit=4.0)
    assert distance_from(rig, last.north, last.east) == pytest.approx(6.0, abs=0.2)
    assert rig.last(m.Statustext).severity == 4
    braking_from = rig.truth
    braking_time = rig.until(lambda: rig.truth.forward_speed == 0.0, limit=4.0)
    assert 1.8 < braking_time < 3.2
    assert distance_from(rig, braking_from.north, braking_from.east) == pytest.approx(2.3, abs=0.3)


def test_after_the_timeout_it_stays_armed_in_guided() -> None:
    rig = Rig()
    rig.ready_to_drive()
    rig.run(2.0, velocity(1.0))
    rig.run(6.0)
    seen = rig.last(m.Heartbeat)
    assert (seen.custom_mode, seen.base_mode & 128) == (GUIDED, 128)
    rig.run(2.0, velocity(1.0))
    assert rig.truth.forward_speed == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("rate", [50.0, 10.0, 1.0])
def test_setpoint_rates_from_50_to_1_hz_drive_smoothly(rate: float) -> None:
    rig = Rig()
    rig.ready_to_drive()
    rig.run(3.0, velocity(1.0), rate=rate)
    for _ in range(50):
        rig.run(0.1, velocity(1.0), rate=rate)
        assert rig.truth.forward_speed == pytest.approx(1.0, abs=0.1)


def test_a_setpoint_sent_while_disarmed_is_kept_and_driven_when_armed() -> None:
    rig = Rig()
    rig.set_mode(GUIDED)
    rig.send(velocity(1.0))
    rig.run(1.5)
    assert rig.truth.forward_speed == 0.0
    rig.arm()
    rig.run(1.0)
    assert rig.truth.forward_speed > 0.5


def test_a_zero_setpoint_clears_the_one_that_was_kept() -> None:
    rig = Rig()
    rig.set_mode(GUIDED)
    rig.send(velocity(1.0), velocity(0.0))
    rig.arm()
    rig.run(1.0)
    assert rig.truth.forward_speed == 0.0


def test_a_setpoint_kept_while_disarmed_times_out_all_the_same() -> None:
    rig = Rig()
    rig.set_mode(GUIDED)
    rig.send(velocity(1.0))
    rig.run(3.2)
    assert TIMEOUT_TEXT in rig.texts()
    rig.arm()
    rig.run(1.0)
    assert rig.truth.forward_speed == 0.0


def test_entering_guided_forgets_the_target_but_asking_again_does_not() -> None:
    rig = Rig()
    rig.set_mode(GUIDED)
    rig.send(velocity(1.0))
    rig.set_mode(GUIDED)
    rig.arm()
    rig.run(1.0)
    assert rig.truth.forward_speed > 0.5
    rig.set_mode(HOLD)
    rig.set_mode(GUIDED)
    rig.run(3.0)
    assert rig.truth.forward_speed == 0.0


def test_zero_setpoints_stop_it_exactly() -> None:
    rig = Rig()
    rig.ready_to_drive()
    rig.run(3.0, body_velocity(1.0, yaw_rate=0.4))
    rig.run(3.0, body_velocity(0.0))
    stopped = rig.truth
    assert (stopped.forward_speed, stopped.yaw_rate) == (0.0, 0.0)
    rig.run(2.0, body_velocity(0.0))
    assert (rig.truth.north, rig.truth.east, rig.truth.yaw) == (
        stopped.north,
        stopped.east,
        stopped.yaw,
    )


def test_change_speed_holds_for_a_position_target_only() -> None:
    rig = Rig()
    rig.set_mode(MANUAL)
    assert rig.command(MavCmd.DO_CHANGE_SPEED, 1, 2.0) == MavResult.FAILED
    rig.ready_to_drive()
    rig.send(local_target(POSITION, position=(20.0, 0.0)))
    assert rig.command(MavCmd.DO_CHANGE_SPEED, 1, -1.0) == MavResult.FAILED
    assert rig.command(MavCmd.DO_CHANGE_SPEED, 1, 0.8) == MavResult.ACCEPTED
    rig.run(4.0)
    assert rig.truth.forward_speed == pytest.approx(0.8, abs=0.02)


def test_a_late_control_loop_loses_time_instead_of_jumping() -> None:
    rig = Rig()
    rig.ready_to_drive()
    rig.run(2.0, velocity(1.0))
    before = rig.truth
    rig.now += 60.0
    rig.vehicle.handle_deadline(now=rig.now)
    assert rig.truth.time - before.time == pytest.approx(0.5, abs=0.03)
    rig.send(heartbeat())
    assert rig.vehicle.next_deadline() > rig.now
