"""A PX4 1.17 rover as it was recorded and tried: zero velocity, lost setpoints, its own landing."""

from math import cos, pi, radians, sin

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavResult
from rover_sim.body import Pose
from rover_sim.frames import Frame
from rover_sim.modes import Mode
from rover_sim.personas import PX4
from rover_sim.px4_failsafe import Action, action_on_loss
from tests.unit.rover_sim.manoeuvres import ahead, px4, record
from tests.unit.rover_sim.rig import (
    BODY_NED,
    PX4_OFFBOARD,
    PX4_RTL,
    VELOCITY,
    Px4Rig,
    local_target,
    velocity,
)


def facing(yaw: float, frame: Frame = Frame.DIFFERENTIAL, *, slip: float = 0.3) -> Px4Rig:
    """Return a rover that has stood there since it was armed, in OFFBOARD."""
    rig = Px4Rig(start=Pose(yaw=yaw), persona=PX4.on(frame), slip=slip)
    assert rig.arm() == MavResult.ACCEPTED
    rig.run(1.0, velocity(1e-3 * cos(yaw), 1e-3 * sin(yaw)))
    assert rig.set_mode(PX4_OFFBOARD) == MavResult.ACCEPTED
    return rig


@pytest.mark.parametrize(
    ("heading", "zeros", "course"),
    [
        (90, velocity(0.0, 0.0), 0),
        (-180, velocity(0.0, 0.0), 0),
        (90, velocity(-0.0, 0.0), 180),  # 0.0 * cos of a heading beyond 90 degrees
        (-90, velocity(-0.0, -0.0), 180),
    ],
)
def test_zero_velocity_turns_a_differential_rover_to_north_or_south(
    heading: float, zeros: m.SetPositionTargetLocalNed, course: float
) -> None:
    rig = facing(radians(heading))
    run = record(rig, 4.0, zeros)
    assert abs(cos(rig.truth.yaw) - cos(radians(course))) < 1e-3
    assert run.way < 0.001
    assert 150 < abs(run.peak_rate) < 260  # deg/s; recorded 196


@pytest.mark.parametrize("speed", [1e-6, 1e-4, 1e-3])
def test_a_millimetre_a_second_along_its_heading_stands(speed: float) -> None:
    yaw = radians(70)
    run = record(facing(yaw), 4.0, velocity(speed * cos(yaw), speed * sin(yaw)))
    assert abs(run.turned) < 0.1
    assert run.way < 0.005


def test_a_millimetre_a_second_to_the_right_turns_a_differential_rover_on_the_spot() -> None:
    run = record(facing(0.0), 4.0, velocity(0.0, 1e-3))
    assert run.turned == pytest.approx(90.0, abs=0.5)
    assert run.way < 0.005


def test_an_ackermann_rover_bends_while_it_brakes_on_zeros() -> None:
    rig = facing(radians(40), Frame.ACKERMANN)
    record(rig, 5.0, velocity(cos(radians(40)), sin(radians(40))))
    run = record(rig, 3.0, velocity(0.0, 0.0))
    assert -40 < run.turned < -5
    assert run.states[-1].forward_speed == 0.0


def test_a_negative_velocity_turns_it_round_and_drives_forwards() -> None:
    rig = facing(0.0, slip=0.0)  # the recorded one's wheels did not slip: 250 deg/s
    run = record(rig, 5.0, velocity(-0.5, 0.0))
    assert abs(run.turned) == pytest.approx(180.0, abs=1.0)
    assert run.steady() == pytest.approx(0.5, abs=0.01)
    assert abs(run.peak_rate) == pytest.approx(250.0, abs=10.0)


def test_a_yaw_rate_is_ignored_and_body_velocity_is_driven() -> None:
    rig = facing(radians(30))
    stream = local_target(VELOCITY & ~0x0800, frame=BODY_NED, velocity=(0.5, 0.0), yaw_rate=1.0)
    run = record(rig, 4.0, stream)
    assert abs(run.turned) < 0.5
    assert run.steady() == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("frame", [7, 9, 12])
def test_other_frames_are_refused_with_a_text_each(frame: int) -> None:
    rig = facing(0.0)
    rig.take(m.Statustext)
    rig.send(local_target(VELOCITY, frame=frame, velocity=(0.5, 0.0)))
    assert "".join(rig.texts()) == (
        f"SET_POSITION_TARGET_LOCAL_NED coordinate frame {frame} unsupported"
    )


def lost(frame: Frame = Frame.DIFFERENTIAL, seconds: float = 15.0) -> Px4Rig:
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


def close_to_home(rig: Px4Rig) -> bool:
    return abs(rig.truth.north) < 0.6 and abs(rig.truth.east) < 0.3


def test_the_times_of_a_drive_home_are_as_recorded() -> None:
    """22 m: return after 1.1 s, landed after 15.7 s, disarmed 2 s later."""
    rig = lost(seconds=22.5)
    record(rig, 1.1)
    assert rig.autopilot.mode is Mode.RTL
    record(rig, 12.0)
    assert "Landing detected" not in rig.texts()
    record(rig, 3.5)
    assert rig.texts()[-1] == "Landing detected"
    assert rig.autopilot.armed
    record(rig, 2.1)
    assert rig.texts()[-1] == "Disarmed by landing"


def test_setpoints_that_return_bring_it_back_to_offboard_by_itself() -> None:
    rig = lost()
    record(rig, 3.0)
    assert rig.mode() == PX4_RTL
    record(rig, 0.2, ahead(rig, 0.5))
    assert (rig.mode(), rig.autopilot.armed) == (PX4_OFFBOARD, True)


def test_once_it_has_disarmed_itself_setpoints_do_nothing() -> None:
    rig = lost()
    record(rig, 25.0)
    assert not rig.autopilot.armed
    run = record(rig, 3.0, ahead(rig, 0.5))
    assert (run.way, rig.mode(), rig.autopilot.armed) == (0.0, PX4_OFFBOARD, False)


def test_an_ackermann_rover_returns_by_a_loop_and_too_fast() -> None:
    rig = lost(Frame.ACKERMANN, 20.0)
    run = record(rig, 25.0)
    assert abs(run.turned) > 150
    assert run.peak == pytest.approx(3.27, rel=0.05)
    assert abs(rig.truth.north) < 0.6
    assert not rig.autopilot.armed


def test_a_return_that_somebody_asked_for_ends_disarmed_too() -> None:
    rig = lost()
    rig.set_mode(PX4_RTL)
    record(rig, 25.0)
    assert rig.texts()[-1] == "Disarmed by landing"
    assert (rig.mode(), rig.autopilot.armed) == (PX4_RTL, False)


@pytest.mark.parametrize(
    ("offboard_loss", "stick_loss", "mode", "armed"),
    [
        (5, 2, Mode.HOLD, True),
        (3, 1, Mode.RTL, True),
        (4, 2, Mode.LAND, True),
        (6, 2, Mode.GUIDED, False),
        (7, 2, Mode.GUIDED, False),
        (0, 1, Mode.HOLD, True),
        (1, 3, Mode.LAND, True),
        (2, 6, Mode.GUIDED, False),
        (0, 0, Mode.GUIDED, True),  # no action: it drives on
    ],
)
def test_parameters_choose_what_a_lost_stream_is_answered_with(
    offboard_loss: int, stick_loss: int, mode: Mode, armed: bool
) -> None:
    rig = lost()
    rig.autopilot.parameters["COM_OBL_RC_ACT"] = offboard_loss
    rig.autopilot.parameters["NAV_RCL_ACT"] = stick_loss
    record(rig, 1.3)
    assert (rig.autopilot.mode, rig.autopilot.armed) == (mode, armed)


def test_without_an_action_it_drives_on_for_good() -> None:
    rig = lost()
    rig.autopilot.parameters["NAV_RCL_ACT"] = 0
    run = record(rig, 20.0)
    assert run.steady() == pytest.approx(1.0, abs=0.01)


def test_only_hold_stands() -> None:
    rig = lost()
    rig.autopilot.parameters["COM_OBL_RC_ACT"] = 5
    run = record(rig, 20.0)
    assert run.way == pytest.approx(1.2, abs=0.2)
    assert rig.autopilot.armed


def test_land_disarms_it_where_it_is() -> None:
    rig = lost()
    rig.autopilot.parameters["COM_OBL_RC_ACT"] = 4
    run = record(rig, 6.0)
    assert run.way == pytest.approx(1.2, abs=0.2)
    assert rig.texts()[-1] == "Disarmed by landing"


@pytest.mark.parametrize("stick_loss", [-1, 0, 1, 2, 3, 4, 5, 6])
def test_sticks_that_are_held_take_the_first_three_actions(stick_loss: int) -> None:
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


def test_without_sticks_the_first_three_are_what_their_loss_is() -> None:
    table = [
        [action_on_loss(action, loss, sticks=False) for loss in range(7)] for action in range(3)
    ]
    row = [
        Action.NONE,
        Action.HOLD,
        Action.RETURN,
        Action.LAND,
        Action.NONE,
        Action.TERMINATE,
        Action.DISARM,
    ]
    assert table == [row, row, row]


def test_sticks_that_are_held_stop_it_instead_of_a_return() -> None:
    rig = lost()
    rig.autopilot.operator_sticks(0.0, 0.0)
    run = record(rig, 5.0)
    assert rig.autopilot.mode is Mode.POSITION
    assert run.stood_after[1] < 1.5


def test_zeros_along_a_southerly_heading_turn_it_to_south() -> None:
    """Zeros as the recorder made them: 0 times the cosine and sine of a southerly heading."""
    yaw = pi * 0.9
    rig = facing(yaw)
    record(rig, 3.0, velocity(0.0 * cos(yaw), 0.0 * sin(yaw)))
    assert abs(rig.truth.yaw) == pytest.approx(pi, abs=0.01)
