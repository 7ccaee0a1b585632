"""A remote control: RC_CHANNELS_OVERRIDE, a transmitter, and what ArduPilot makes of them."""

from dataclasses import replace

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavResult
from rover_sim.frames import Frame
from rover_sim.personas import ARDUPILOT, PX4
from tests.unit.rover_sim.real_rig import RealRig
from tests.unit.rover_sim.rig import BODY_NED, MANUAL, VELOCITY_AND_RATE


def velocity(speed: float) -> m.SetPositionTargetLocalNed:
    return m.SetPositionTargetLocalNed(
        0, 1, 1, BODY_NED, VELOCITY_AND_RATE, 0, 0, 0, speed, 0, 0, 0, 0, 0, 0, 0
    )


def throttle(pulse: int) -> m.RcChannelsOverride:
    keep = 65535
    return m.RcChannelsOverride(1, 1, keep, keep, pulse, keep, keep, keep, keep, keep)


@pytest.mark.parametrize("asked", [0.0, 0.5])
def test_the_throttle_stick_drives_in_guided_whatever_is_asked(asked: float) -> None:
    rig = RealRig(ARDUPILOT)
    rig.get_ready()
    rig.run(2.0, velocity(asked))
    assert rig.truth.forward_speed == pytest.approx(asked, abs=0.1)
    for _ in range(30):
        rig.send(throttle(1750))
        rig.run(0.1, velocity(asked))
    assert 1.9 / 1.5 < rig.truth.forward_speed < 1.9 * 1.5  # recorded on skid steer
    rig.send(throttle(0))
    rig.run(4.0, velocity(asked))
    assert rig.truth.forward_speed == pytest.approx(asked, abs=0.1)


def test_an_ackermann_rover_drives_faster_by_the_stick_and_swings_back_beyond_zero() -> None:
    """Recorded with 0 m/s asked: 2.6 m/s after 3 s, and -0.41 m/s after the release."""
    rig = RealRig(ARDUPILOT.on(Frame.ACKERMANN))
    rig.get_ready()
    for _ in range(30):
        rig.send(throttle(1750))
        rig.run(0.1, velocity(0.0))
    assert 2.6 / 1.5 < rig.truth.forward_speed < 2.6 * 1.5
    rig.send(throttle(0))
    speeds = []
    for _ in range(40):
        rig.run(0.1, velocity(0.0))
        speeds.append(rig.truth.forward_speed)
    assert 0.41 / 1.5 < -min(speeds) < 0.41 * 1.5


def test_an_override_that_is_not_repeated_ends_after_three_seconds() -> None:
    rig = RealRig(ARDUPILOT)
    rig.get_ready()
    rig.send(throttle(1750))
    rig.run(2.5, velocity(0.0))
    assert rig.truth.forward_speed > 1.0
    rig.run(4.0, velocity(0.0))
    assert rig.truth.forward_speed == pytest.approx(0.0, abs=0.1)


def test_the_stick_does_not_turn_a_reversing_rover_round() -> None:
    rig = RealRig(ARDUPILOT)
    rig.get_ready()
    rig.send(throttle(1750))
    rig.run(2.0, velocity(-0.5))
    assert rig.truth.forward_speed < -0.3


def test_the_rover_shows_its_channels() -> None:
    rig = RealRig(ARDUPILOT, wait=3.0)
    assert rig.ask(MavCmd.SET_MESSAGE_INTERVAL, 65, 100_000).result == MavResult.ACCEPTED
    rig.send(throttle(1750))
    rig.run(0.2)
    shown = rig.last(m.RcChannels)
    assert (shown.chancount, shown.chan1_raw, shown.chan3_raw) == (8, 1500, 1750)
    rig.send(throttle(0))
    rig.run(0.2)
    assert rig.last(m.RcChannels).chan3_raw == 1500


def test_a_transmitter_s_throttle_counts_in_guided_and_is_shown() -> None:
    rig = RealRig(ARDUPILOT)
    rig.get_ready()
    rig.autopilot.operator_pulses(1750, 1500)
    rig.run(4.0, velocity(0.0))
    assert rig.truth.forward_speed == pytest.approx(1.87, abs=0.2)
    assert rig.last(m.RcChannels).chan3_raw == 1750


def test_in_manual_the_channels_drive() -> None:
    rig = RealRig(ARDUPILOT)
    rig.get_ready()
    rig.set_mode_by(MANUAL)
    rig.send(throttle(1600))
    rig.run(2.0)
    assert rig.truth.forward_speed == pytest.approx(0.6, abs=0.1)


def test_sticks_held_in_metres_per_second_are_shown_in_microseconds() -> None:
    rig = RealRig(ARDUPILOT, wait=3.0)
    rig.autopilot.operator_sticks(1.0, 0.0)
    rig.run(1.1)
    assert 1600 < rig.last(m.RcChannels).chan3_raw < 1700


def test_px4_has_no_receiver_unless_somebody_holds_a_transmitter() -> None:
    rig = RealRig(PX4, wait=3.0)
    assert not rig.take(m.RcChannels)
    rig.autopilot.operator_pulses(1500, 1600)
    rig.run(1.5)
    assert rig.last(m.RcChannels).chan1_raw == 1600


def test_a_rover_with_a_faster_frame_is_driven_faster() -> None:
    rig = RealRig(ARDUPILOT, realism=replace(ARDUPILOT.realism, stick_speed=16.7))
    rig.get_ready()
    rig.send(throttle(1750))
    rig.run(2.9, velocity(0.0))
    assert 2.6 / 1.5 < rig.truth.forward_speed < 3.1 * 1.5  # recorded on Ackermann, after 3 s


def test_an_ardupilot_is_not_armed_while_the_throttle_stick_is_off_its_centre() -> None:
    rig = RealRig(ARDUPILOT)
    rig.run(3.0)
    rig.send(throttle(1700))
    refused = rig.try_to_arm()
    assert refused.result == MavResult.FAILED
    assert refused.texts == ("Arm: Throttle (RC3) is not neutral",)
    rig.send(throttle(1500))
    assert rig.try_to_arm().result == MavResult.ACCEPTED
