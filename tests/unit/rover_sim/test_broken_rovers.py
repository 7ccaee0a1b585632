"""One wheel that stands, one output that is frozen, no satellites: what the rover then does."""

from collections.abc import Callable

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavResult
from rover_sim.actuators import Actuator, with_blocked, with_frozen
from rover_sim.faults import Faults
from rover_sim.frames import Frame
from rover_sim.modes import Mode
from tests.unit.rover_sim.manoeuvres import ahead, ardupilot, px4, record
from tests.unit.rover_sim.rig import HOLD, Px4Rig, Rig

LEFT, RIGHT = frozenset({Actuator.LEFT}), frozenset({Actuator.RIGHT})
GPS_LOST = Faults(gps_lost=True)


def test_with_one_output_frozen_it_circles_on_in_hold() -> None:
    """A13: 0.32 m/s for as long as was watched, no text, no disarm; it drove 0.64 m/s then."""
    rig = ardupilot(Frame.SKID)
    record(rig, 5.0, ahead(rig, 0.64))
    rig.autopilot.set_faults(Faults(outputs_frozen=LEFT))
    rig.take(m.Statustext)
    assert rig.set_mode(HOLD) == MavResult.ACCEPTED
    run = record(rig, 20.0)
    assert run.steady() == pytest.approx(0.32, abs=0.03)
    assert run.turned > 360.0  # the left wheels drive it to the right
    assert rig.autopilot.armed
    assert rig.texts() == []


def test_disarming_stops_a_rover_whose_output_is_frozen() -> None:
    rig = ardupilot(Frame.SKID)
    record(rig, 5.0, ahead(rig, 0.64))
    rig.autopilot.set_faults(Faults(outputs_frozen=LEFT))
    rig.command(MavCmd.COMPONENT_ARM_DISARM, 0)
    assert record(rig, 4.0).states[-1].forward_speed == 0.0


def test_an_ackermann_rover_with_a_frozen_throttle_drives_on_and_can_be_steered() -> None:
    rig = ardupilot(Frame.ACKERMANN)
    record(rig, 5.0, ahead(rig, 1.0))
    rig.autopilot.set_faults(Faults(outputs_frozen=frozenset({Actuator.THROTTLE})))
    rig.set_mode(HOLD)
    assert record(rig, 10.0).steady() == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ("motion", "blocked", "frame", "left_over"),
    [
        ((1.0, 0.0), frozenset(), Frame.SKID, (1.0, 0.0)),
        ((1.0, 0.0), LEFT | RIGHT, Frame.SKID, (0.0, 0.0)),
        ((1.0, 0.0), LEFT, Frame.SKID, (0.5, -1.0 / 0.46)),
        ((1.0, 0.0), RIGHT, Frame.SKID, (0.5, 1.0 / 0.46)),
        ((1.0, 0.0), LEFT, Frame.ACKERMANN, (0.5, -0.1)),
        ((-1.0, 0.0), LEFT, Frame.ACKERMANN, (-0.5, 0.1)),
    ],
)
def test_a_wheel_that_stands_is_driven_around(
    motion: tuple[float, float],
    blocked: frozenset[Actuator],
    frame: Frame,
    left_over: tuple[float, float],
) -> None:
    assert with_blocked(motion, blocked, frame) == pytest.approx(left_over)


def test_a_frozen_steering_keeps_its_arc_at_any_speed() -> None:
    steering = frozenset({Actuator.STEERING})
    assert with_frozen((0.5, 0.0), (1.0, 0.4), steering) == pytest.approx((0.5, 0.2))
    assert with_frozen((0.5, 0.3), (0.0, 0.0), steering) == (0.5, 0.0)


@pytest.mark.parametrize("make", [ardupilot, px4])
def test_without_satellites_it_drives_on_for_5_s_and_then_has_no_position(
    make: Callable[[Frame], Rig],
) -> None:
    rig = make(Frame.SKID)
    record(rig, 3.0, ahead(rig, 0.5))
    rig.autopilot.set_faults(GPS_LOST)
    rig.take(m.Statustext)
    record(rig, 4.0, ahead(rig, 0.5))
    assert rig.autopilot.mode is Mode.GUIDED
    assert rig.take(m.LocalPositionNed) != []
    rig.command(MavCmd.REQUEST_MESSAGE, m.GpsRawInt.id)
    assert rig.last(m.GpsRawInt).fix_type == 0
    record(rig, 1.5, ahead(rig, 0.5))
    rig.take(m.LocalPositionNed)
    record(rig, 2.0, ahead(rig, 0.5))
    assert rig.take(m.LocalPositionNed) == []


def test_ardupilot_then_holds_and_cannot_be_armed() -> None:
    rig = ardupilot(Frame.SKID)
    rig.autopilot.set_faults(GPS_LOST)
    record(rig, 6.0, ahead(rig, 0.5))
    assert (rig.autopilot.mode, rig.texts()[-1]) == (Mode.HOLD, "EKF failsafe")
    rig.command(MavCmd.COMPONENT_ARM_DISARM, 0)
    assert rig.arm() == MavResult.FAILED
    assert rig.texts()[-1] == "Arm: Need Position Estimate"
    rig.autopilot.set_faults(Faults())
    assert rig.arm() == MavResult.ACCEPTED


def test_px4_then_lands_where_it_is_and_disarms() -> None:
    rig: Px4Rig = px4(Frame.DIFFERENTIAL)
    rig.autopilot.set_faults(GPS_LOST)
    record(rig, 12.0, ahead(rig, 0.5))
    assert "Failsafe activated" in rig.texts()
    assert rig.texts()[-1] == "Disarmed by landing"
    assert rig.truth.forward_speed == 0.0
    assert not rig.autopilot.armed
