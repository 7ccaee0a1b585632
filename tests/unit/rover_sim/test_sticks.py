"""A remote control: RC_CHANNELS_OVERRIDE, a transmitter, and what ArduPilot makes of them."""

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavResult
from rover_sim.personas import ARDUPILOT
from tests.unit.rover_sim.rig import BODY_NED, MANUAL, VELOCITY_AND_RATE, RealRig


def velocity(speed: float) -> m.SetPositionTargetLocalNed:
    return m.SetPositionTargetLocalNed(
        0, 1, 1, BODY_NED, VELOCITY_AND_RATE, 0, 0, 0, speed, 0, 0, 0, 0, 0, 0, 0
    )


def throttle(pulse: int) -> m.RcChannelsOverride:
    keep = 65535
    return m.RcChannelsOverride(1, 1, keep, keep, pulse, keep, keep, keep, keep, keep)


def test_the_throttle_stick_drives_in_guided_whatever_is_asked() -> None:
    for asked in [0.0, 0.5]:
        rig = RealRig(ARDUPILOT)
        rig.run(3.0)
        rig.ready_to_drive()
        rig.run(2.0, velocity(asked))
        assert rig.truth.forward_speed == pytest.approx(asked, abs=0.1)
        for _ in range(30):
            rig.send(throttle(1750))
            rig.run(0.1, velocity(asked))
        assert 1.9 / 1.5 < rig.truth.forward_speed < 1.9 * 1.5  # recorded on skid steer
        rig.send(throttle(0))
        rig.run(4.0, velocity(asked))
        assert rig.truth.forward_speed == pytest.approx(asked, abs=0.1)


def test_an_override_that_is_not_repeated_ends_after_three_seconds() -> None:
    rig = RealRig(ARDUPILOT)
    rig.run(3.0)
    rig.ready_to_drive()
    rig.send(throttle(1750))
    rig.run(2.5, velocity(0.0))
    assert rig.truth.forward_speed > 1.0
    rig.run(4.0, velocity(0.0))
    assert rig.truth.forward_speed == pytest.approx(0.0, abs=0.1)


def test_in_manual_the_channels_drive() -> None:
    rig = RealRig(ARDUPILOT)
    rig.run(3.0)
    rig.ready_to_drive()
    rig.set_mode(MANUAL)
    rig.send(throttle(1600))
    rig.run(2.0)
    assert rig.truth.forward_speed == pytest.approx(0.6, abs=0.1)


def test_an_ardupilot_is_not_armed_while_the_throttle_stick_is_off_its_centre() -> None:
    rig = RealRig(ARDUPILOT)
    rig.run(3.0)
    rig.send(throttle(1700))
    refused = rig.try_to_arm()
    assert refused.result == MavResult.FAILED
    assert refused.texts == ("Arm: Throttle (RC3) is not neutral",)
    rig.send(throttle(1500))
    assert rig.try_to_arm().result == MavResult.ACCEPTED
