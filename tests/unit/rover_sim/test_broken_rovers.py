"""One wheel that stands, one output that is frozen, no satellites: what the rover then does."""

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavResult
from rover_sim.actuators import Actuator
from rover_sim.faults import Faults
from rover_sim.frames import Frame
from rover_sim.modes import Mode
from tests.unit.rover_sim.rig import HOLD, Rig, ahead, ardupilot, px4, record

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


def test_without_satellites_it_drives_on_for_5_s_and_then_has_no_position() -> None:
    for make in [ardupilot, px4]:
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
    rig: Rig = px4(Frame.DIFFERENTIAL)
    rig.autopilot.set_faults(GPS_LOST)
    record(rig, 12.0, ahead(rig, 0.5))
    assert "Failsafe activated" in rig.texts()
    assert rig.texts()[-1] == "Disarmed by landing"
    assert rig.truth.forward_speed == 0.0
    assert not rig.autopilot.armed
