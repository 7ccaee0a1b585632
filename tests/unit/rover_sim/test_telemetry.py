"""What the rover tells about itself, and how often."""

from collections import Counter

import pytest

from mav_tasks.mavlink import messages as m
from rover_sim.faults import Faults
from tests.unit.rover_sim.rig import GUIDED, Rig, body_velocity

STREAMED = {
    m.Heartbeat,
    m.SysStatus,
    m.ExtendedSysState,
    m.HomePosition,
    m.Attitude,
    m.LocalPositionNed,
    m.GlobalPositionInt,
    m.GpsRawInt,
    m.VfrHud,
    m.BatteryStatus,
    m.SystemTime,
    m.MissionCurrent,
    m.RcChannels,
}


def test_everything_streams_at_1_hz_unasked() -> None:
    rig = Rig(wait=2.01)
    rig.heard.clear()
    rig.run(5.0)
    assert Counter(type(message) for message in rig.heard) == dict.fromkeys(STREAMED, 5)


def test_faults_of_the_estimate_show_in_position_only() -> None:
    rig = Rig()
    rig.ready_to_drive()
    rig.run(2.0, body_velocity(1.0))
    rig.autopilot.set_faults(Faults(position_frozen=True))
    rig.run(1.1, body_velocity(1.0, yaw_rate=0.3))
    frozen = rig.last(m.LocalPositionNed)
    rig.run(2.0, body_velocity(1.0, yaw_rate=0.3))
    after = rig.last(m.LocalPositionNed)
    assert (after.x, after.y, after.vx) == (frozen.x, frozen.y, frozen.vx)
    assert after.time_boot_ms > frozen.time_boot_ms
    assert rig.last(m.Attitude).yawspeed == pytest.approx(0.3, abs=0.02)
    rig.autopilot.set_faults(Faults(position_jump=(10.0, -5.0)))
    rig.run(1.1)
    jumped = rig.last(m.LocalPositionNed)
    assert jumped.x == pytest.approx(rig.truth.north + 10.0, abs=1.5)


def test_telemetry_can_be_withheld_or_silenced_altogether() -> None:
    rig = Rig()
    rig.autopilot.set_faults(Faults(withheld=frozenset({m.BatteryStatus.id})))
    rig.heard.clear()
    rig.run(2.0)
    assert rig.heard
    assert rig.take(m.BatteryStatus) == []
    rig.autopilot.set_faults(Faults(silent=True))
    rig.send(m.CommandLong(1, 1, 176, 0, 1, GUIDED, 0, 0, 0, 0, 0))
    rig.run(2.0)
    assert rig.heard == []
    rig.autopilot.set_faults(Faults())
    rig.run(1.1)
    assert rig.last(m.Heartbeat).custom_mode == GUIDED  # it had heard, and obeyed
