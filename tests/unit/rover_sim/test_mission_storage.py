"""The rover's own mission storage, as a ground station meets it."""

import math

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavMissionResult
from rover_sim.geo import DEFAULT_ORIGIN
from tests.unit.rover_sim.rig import AUTO, CLIENT, Px4Rig, Rig

OTHER_CLIENT = Address(255, 190)


def waypoint(seq: int, north: float, east: float, *, frame: int = 6) -> m.MissionItemInt:
    x, y = DEFAULT_ORIGIN.to_global(north, east)
    return m.MissionItemInt(1, 1, seq, frame, 16, seq == 0, 1, 0, 0, 0, 0, x, y, 0.0)


def upload(rig: Rig, items: list[m.MissionItemInt]) -> MavMissionResult:
    rig.take(m.MissionRequest)
    rig.send(m.MissionCount(1, 1, len(items)))
    for item in items:
        asked = rig.take(m.MissionRequest)
        assert [request.seq for request in asked] == [item.seq]
        rig.send(item)
    (ack,) = rig.take(m.MissionAck)
    assert Address(ack.target_system, ack.target_component) == CLIENT
    assert ack.opaque_id == 0  # ArduPilot knows none
    return MavMissionResult(ack.type)


SQUARE = [waypoint(0, 9.0, 9.0), waypoint(1, 3.0, 0.0), waypoint(2, 3.0, 3.0)]


def test_upload_and_download_with_home_as_item_0() -> None:
    rig = Rig()
    assert upload(rig, SQUARE) == MavMissionResult.ACCEPTED
    rig.send(m.MissionRequestList(1, 1))
    assert rig.take(m.MissionCount)[0].count == 3
    rig.send(*(m.MissionRequestInt(1, 1, seq) for seq in range(3)))
    home, first, second = rig.take(m.MissionItemInt)
    assert (home.x, home.y) == DEFAULT_ORIGIN.to_global(0.0, 0.0)
    assert (first.seq, first.frame, first.command) == (1, 3, 16)  # frame 6 comes back as 3
    assert (second.x, second.y) == DEFAULT_ORIGIN.to_global(3.0, 3.0)


def test_auto_drives_the_stored_mission_to_its_end() -> None:
    rig = Rig()
    upload(rig, SQUARE)
    rig.set_mode(AUTO)
    rig.arm()
    rig.until(lambda: "Mission Complete" in rig.texts(), limit=20.0)
    assert math.dist((3.0, 3.0), (rig.truth.north, rig.truth.east)) < 0.4
    rig.run(1.1)
    assert rig.last(m.MissionCurrent).mission_state == 5
    assert rig.last(m.Heartbeat).custom_mode == AUTO
    assert [reached.seq for reached in rig.take(m.MissionItemReached)] == [1, 2]


def test_items_that_cannot_be_stored_end_the_upload() -> None:
    rig = Rig()
    bad_latitude = waypoint(0, 0, 0)
    bad_latitude.x = 910_000_000
    assert upload(rig, [bad_latitude]) == MavMissionResult.INVALID_PARAM5_X
    unknown = waypoint(0, 0, 0)
    unknown.command = 31_000
    assert upload(rig, [unknown]) == MavMissionResult.UNSUPPORTED


def test_a_second_client_is_denied_and_the_first_undisturbed() -> None:
    rig = Rig()
    rig.send(m.MissionCount(1, 1, 1))
    rig.take(m.MissionRequest)
    rig.send_from(OTHER_CLIENT, m.MissionCount(1, 1, 5))
    (denied,) = rig.take(m.MissionAck)
    assert (denied.type, denied.target_system) == (MavMissionResult.DENIED, 255)
    rig.send(waypoint(0, 0, 0))
    assert rig.take(m.MissionAck)[0].type == MavMissionResult.ACCEPTED


def guided_item(north: float, east: float) -> m.MissionItem:
    x, y = DEFAULT_ORIGIN.to_global(north, east)
    return m.MissionItem(1, 1, 0, 3, 16, 2, 1, 0, 0, 0, 0, x * 1e-7, y * 1e-7, 0.0)


def test_a_lone_item_marked_2_sends_it_there_in_guided() -> None:
    rig = Rig()
    rig.ready_to_drive()
    rig.send(guided_item(3.0, 0.0))
    assert [ack.type for ack in rig.take(m.MissionAck)] == [MavMissionResult.ACCEPTED]
    rig.run(6.0)
    assert rig.truth.north == pytest.approx(3.0, abs=1.0)  # float32 degrees resolve that


def test_a_lone_item_marked_2_is_refused_in_another_mode_and_by_px4() -> None:
    for rig in (Rig(), Px4Rig()):
        rig.send(guided_item(3.0, 0.0))
        assert [ack.type for ack in rig.take(m.MissionAck)] == [MavMissionResult.ERROR]
