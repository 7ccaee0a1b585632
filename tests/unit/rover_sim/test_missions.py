"""The rover's own mission storage, as a ground station meets it: missions, fences, rally points."""

import math

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavMissionResult
from rover_sim.geo import DEFAULT_ORIGIN
from tests.unit.rover_sim.rig import AUTO, CLIENT, PX4_HOLD, PX4_MISSION, Px4Rig, Rig

MISSION, FENCE, RALLY = 0, 1, 2


def item(
    seq: int, north: float = 0.0, east: float = 0.0, *, command: int = 16, kind: int = MISSION
) -> m.MissionItemInt:
    x, y = DEFAULT_ORIGIN.to_global(north, east)
    return m.MissionItemInt(1, 1, seq, 6, command, seq == 0, 1, 0, 0, 0, 0.0, x, y, 2.0, kind)


def requests(rig: Rig) -> list[m.MissionRequestInt] | list[m.MissionRequest]:
    """Return what it asks for as its make does, and forget it."""
    return rig.take(m.MissionRequestInt) if rig.speaks_px4 else rig.take(m.MissionRequest)


def upload(rig: Rig, items: list[m.MissionItemInt], kind: int = MISSION) -> m.MissionAck:
    """Upload a plan; every item is asked for once, in order, as its make asks."""
    requests(rig)
    rig.send(m.MissionCount(1, 1, len(items), kind))
    for each in items:
        assert [(one.seq, one.mission_type) for one in requests(rig)] == [(each.seq, kind)]
        rig.send(each)
    (ack,) = rig.take(m.MissionAck)
    assert Address(ack.target_system, ack.target_component) == CLIENT
    assert rig.speaks_px4 or ack.opaque_id == 0  # ArduPilot knows none
    return ack


CORNER = [item(0, 3.0, 0.0), item(1, 3.0, 3.0)]
#: item 0 is home: it comes back as such
SQUARE = [item(0, 9.0, 9.0), item(1, 3.0, 0.0), item(2, 3.0, 3.0)]
PLANS = {
    MISSION: CORNER,
    FENCE: [item(0, 50.0, 0.0, command=5003, kind=FENCE)],
    RALLY: [item(0, 1.0, 1.0, command=5100, kind=RALLY)],
}


def driven_to_its_end(rig: Rig) -> list[int]:
    """Return the items that it says it has reached."""
    rig.until(lambda: "Mission Complete" in rig.texts(), limit=20.0)
    assert math.dist((3.0, 3.0), (rig.truth.north, rig.truth.east)) < 0.5
    rig.run(1.1)
    assert rig.last(m.MissionCurrent).mission_state == 5
    return [reached.seq for reached in rig.take(m.MissionItemReached)]


def test_auto_drives_the_stored_mission_to_its_end() -> None:
    rig = Rig()
    upload(rig, SQUARE)
    rig.set_mode(AUTO)
    rig.arm()
    assert driven_to_its_end(rig) == [1, 2]
    assert rig.mode() == AUTO


def test_px4_arms_by_mission_start_and_holds_at_its_end() -> None:
    rig = Px4Rig()
    upload(rig, CORNER)
    rig.command(MavCmd.MISSION_START)
    assert (rig.mode(), rig.autopilot.armed) == (PX4_MISSION, True)
    assert driven_to_its_end(rig) == [0, 1]
    assert rig.mode() == PX4_HOLD


def test_a_plan_of_px4_has_an_id_in_ack_count_and_current_until_it_is_cleared() -> None:
    rig = Px4Rig()
    ids = [upload(rig, items, kind).opaque_id for kind, items in PLANS.items()]
    assert len({0, *ids}) == 4
    rig.send(*(m.MissionRequestList(1, 1, kind) for kind in PLANS))
    assert [count.opaque_id for count in rig.take(m.MissionCount)] == ids
    for cleared, left in [(None, ids), (FENCE, [ids[0], 0, ids[2]]), (255, [0, 0, 0])]:
        if cleared is not None:
            rig.send(m.MissionClearAll(1, 1, cleared))
        rig.run(1.1)
        shown = rig.last(m.MissionCurrent)
        assert [shown.mission_id, shown.fence_id, shown.rally_points_id] == left
        assert (shown.total, shown.mission_state) == ((2, 2) if left[0] else (65535, 1))


def test_items_that_cannot_be_stored_end_the_upload() -> None:
    rig, bad_latitude, unknown = Rig(), item(0), item(0, command=31_000)
    bad_latitude.x = 910_000_000
    assert upload(rig, [bad_latitude]).type == MavMissionResult.INVALID_PARAM5_X
    assert upload(rig, [unknown]).type == MavMissionResult.UNSUPPORTED


def test_a_lone_item_marked_2_sends_it_there_in_guided_and_only_there() -> None:
    x, y = DEFAULT_ORIGIN.to_global(3.0, 0.0)
    guided = m.MissionItem(1, 1, 0, 3, 16, 2, 1, 0, 0, 0, 0, x * 1e-7, y * 1e-7, 0.0)
    there, *elsewhere = rigs = Rig(), Rig(), Px4Rig()
    there.ready_to_drive()
    for rig in rigs:
        rig.send(guided)
    assert [ack.type for ack in there.take(m.MissionAck)] == [MavMissionResult.ACCEPTED]
    there.run(6.0)
    assert there.truth.north == pytest.approx(3.0, abs=1.0)  # float32 degrees resolve that
    for rig in elsewhere:
        assert [ack.type for ack in rig.take(m.MissionAck)] == [MavMissionResult.ERROR]
