"""A PX4 1.17 rover as it was recorded and tried: zero velocity, lost setpoints, its own landing."""

from math import cos, radians, sin

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavResult
from rover_sim.body import Pose
from rover_sim.frames import Frame
from rover_sim.modes import Mode
from rover_sim.personas import PX4
from rover_sim.px4_failsafe import Action, action_on_loss
from tests.unit.rover_sim.rig import (
    PX4_OFFBOARD,
    PX4_RTL,
    Rig,
    ahead,
    px4,
    record,
    velocity,
)


def facing(yaw: float, frame: Frame = Frame.DIFFERENTIAL, *, slip: float = 0.3) -> Rig:
    """Return a rover that has stood there since it was armed, in OFFBOARD."""
    rig = Rig(PX4.on(frame), start=Pose(yaw=yaw), slip=slip)
    assert rig.arm() == MavResult.ACCEPTED
    rig.run(1.0, velocity(1e-3 * cos(yaw), 1e-3 * sin(yaw)))
    assert rig.set_mode(PX4_OFFBOARD) == MavResult.ACCEPTED
    return rig


def test_zero_velocity_turns_a_differential_rover_to_north_or_south() -> None:
    for heading, zeros, course in [
        (90, velocity(0.0, 0.0), 0),
        (-180, velocity(0.0, 0.0), 0),
        (90, velocity(-0.0, 0.0), 180),  # 0.0 * cos of a heading beyond 90 degrees
        (-90, velocity(-0.0, -0.0), 180),
    ]:
        rig = facing(radians(heading))
        run = record(rig, 4.0, zeros)
        assert abs(cos(rig.truth.yaw) - cos(radians(course))) < 1e-3
        assert run.way < 0.001
        assert 150 < abs(run.peak_rate) < 260  # deg/s; recorded 196


def lost(frame: Frame = Frame.DIFFERENTIAL, seconds: float = 15.0) -> Rig:
    """Return a rover that has been driven away from where it was armed; its setpoints end."""
    rig = px4(frame)
    record(rig, seconds, ahead(rig, 1.0))
    rig.take(m.Statustext)
    return rig


def test_by_default_lost_setpoints_are_a_drive_home_where_it_disarms_itself() -> None:
    rig = lost()
    away = rig.truth.north
    before = record(rig, 1.1)
    assert rig.mode() == PX4_RTL
    run = record(rig, 25.0)
    assert close_to_home(rig)
    assert before.way + run.way == pytest.approx(away + 1.3, abs=1.5)
    assert run.peak == pytest.approx(1.8, abs=0.05)
    assert rig.texts() == [
        "Failsafe activated",
        "RTL: land at destination",
        "RTL: start return at 644 m (60 m above destination",
        ")",
        "Landing detected",
        "Disarmed by landing",
    ]
    assert (rig.mode(), rig.autopilot.armed) == (PX4_OFFBOARD, False)


def close_to_home(rig: Rig) -> bool:
    return abs(rig.truth.north) < 0.6 and abs(rig.truth.east) < 0.3


def test_parameters_choose_what_a_lost_stream_is_answered_with() -> None:
    for offboard_loss, stick_loss, mode, armed in [
        (5, 2, Mode.HOLD, True),
        (3, 1, Mode.RTL, True),
        (4, 2, Mode.LAND, True),
        (6, 2, Mode.GUIDED, False),
        (7, 2, Mode.GUIDED, False),
        (0, 1, Mode.HOLD, True),
        (1, 3, Mode.LAND, True),
        (2, 6, Mode.GUIDED, False),
        (0, 0, Mode.GUIDED, True),  # no action: it drives on
    ]:
        rig = lost()
        rig.autopilot.parameters["COM_OBL_RC_ACT"] = offboard_loss
        rig.autopilot.parameters["NAV_RCL_ACT"] = stick_loss
        record(rig, 1.3)
        assert (rig.autopilot.mode, rig.autopilot.armed) == (mode, armed)


def test_sticks_that_are_held_take_the_first_three_actions() -> None:
    for stick_loss in [-1, 0, 1, 2, 3, 4, 5, 6]:
        held = [action_on_loss(action, stick_loss, sticks=True) for action in range(-1, 8)]
        assert held == [
            Action.POSITION,  # no such value: as 0
            Action.POSITION,
            Action.STABILIZED,
            Action.STABILIZED,
            Action.RETURN,
            Action.LAND,
            Action.HOLD,
            Action.TERMINATE,
            Action.DISARM,
        ]
