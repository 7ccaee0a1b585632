"""What a PX4 rover tells about itself, and how often."""

import math
from collections import Counter

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavResult
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


def test_it_says_what_it_is() -> None:
    rig = Px4Rig()
    assert rig.command(MavCmd.REQUEST_MESSAGE, m.AutopilotVersion.id) == MavResult.ACCEPTED
    version = rig.last(m.AutopilotVersion)
    mission_int, command_int, bytewise, files, local, mavlink2, fence, rally = (
        *(4, 8, 16, 32),
        *(128, 8192, 16384, 32768),
    )
    for wanted in (mission_int, command_int, bytewise, files, local, mavlink2, fence, rally):
        assert version.capabilities & wanted
    assert not version.capabilities & 2  # parameters are not cast to floats
    assert version.flight_sw_version == 0x011100FF


def test_the_protocol_version_is_told_either_way() -> None:
    """A QGroundControl that is not told falls back to MAVLink 1."""
    rig = Px4Rig()
    assert rig.command(MavCmd.REQUEST_MESSAGE, m.ProtocolVersion.id) == MavResult.ACCEPTED
    assert rig.command(MavCmd.REQUEST_PROTOCOL_VERSION, 1) == MavResult.ACCEPTED
    assert [v.max_version for v in rig.take(m.ProtocolVersion)] == [200, 200]


def test_what_mavsdk_takes_for_health_is_there() -> None:
    rig = Px4Rig(wait=2.5)
    status = rig.last(m.SysStatus)
    for sensor in (1, 2, 4, 32):
        assert status.onboard_control_sensors_present & sensor
        assert status.onboard_control_sensors_health & sensor
    assert status.onboard_control_sensors_health & 0x10000000  # armable
    assert rig.last(m.HomePosition).latitude != 0


def test_file_transfer_is_refused_at_once() -> None:
    rig = Px4Rig()
    rig.send(m.FileTransferProtocol(0, 1, 1, [7, 0, 3, 4, 9] + [0] * 246))
    (answer,) = rig.take(m.FileTransferProtocol)
    assert (answer.payload[3], answer.payload[12]) == (129, 10)


def test_an_interval_goes_back_to_its_own_default() -> None:
    rig = Px4Rig()
    rig.command(MavCmd.SET_MESSAGE_INTERVAL, m.Attitude.id, 1_000_000)
    rig.command(MavCmd.SET_MESSAGE_INTERVAL, m.Attitude.id, 0)
    rig.command(MavCmd.GET_MESSAGE_INTERVAL, m.Attitude.id)
    assert rig.last(m.MessageInterval).interval_us == 25_000


@pytest.mark.parametrize("interval", [1e30, math.inf])
def test_an_interval_of_ages_is_told_as_the_longest_there_is(interval: float) -> None:
    rig = Px4Rig()
    assert rig.command(MavCmd.SET_MESSAGE_INTERVAL, m.Attitude.id, interval) == MavResult.ACCEPTED
    rig.command(MavCmd.GET_MESSAGE_INTERVAL, m.Attitude.id)
    assert rig.last(m.MessageInterval).interval_us == 2**31 - 1
