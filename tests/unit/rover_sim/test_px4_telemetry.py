"""What a PX4 rover tells about itself, and how often."""

from collections import Counter

from mav_tasks.mavlink import messages as m
from tests.unit.rover_sim.rig import Px4Rig

PER_SECOND = {
    m.Heartbeat: 1,
    m.Attitude: 40,
    m.LocalPositionNed: 20,
    m.GlobalPositionInt: 10,
    m.VfrHud: 10,
    m.GpsRawInt: 5,
    m.SysStatus: 5,
    m.ExtendedSysState: 5,
    m.SystemTime: 1,
    m.MissionCurrent: 1,
    m.HomePosition: 0.5,
    m.BatteryStatus: 0.5,
    m.CurrentMode: 0.5,
}


def test_it_streams_unasked() -> None:
    rig = Px4Rig(wait=2.01)
    rig.heard.clear()
    rig.run(4.0)
    counts = Counter(type(message) for message in rig.heard)
    assert counts == {kind: rate * 4 for kind, rate in PER_SECOND.items()}
