"""The life of a setpoint in GUIDED: kept while disarmed, timed out, cleared."""

import math

import pytest

from mav_tasks.mavlink import messages as m
from tests.unit.rover_sim.rig import (
    GUIDED,
    HOLD,
    Rig,
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


def test_a_setpoint_sent_while_disarmed_is_kept_and_driven_when_armed() -> None:
    rig = Rig()
    rig.set_mode(GUIDED)
    rig.send(velocity(1.0))
    rig.run(1.5)
    assert rig.truth.forward_speed == 0.0
    rig.arm()
    rig.run(1.0)
    assert rig.truth.forward_speed > 0.5


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
