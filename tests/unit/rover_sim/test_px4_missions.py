"""Missions, fences and rally points as PX4 takes, names, gives back and drives them."""

import math

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavResult
from rover_sim.geo import DEFAULT_ORIGIN
from tests.unit.rover_sim.rig import CLIENT, PX4_HOLD, PX4_MISSION, Px4Rig, Rig

MISSION, FENCE, RALLY = 0, 1, 2


def item(
    seq: int, north: float = 0.0, east: float = 0.0, *, command: int = 16, kind: int = MISSION
) -> m.MissionItemInt:
    x, y = DEFAULT_ORIGIN.to_global(north, east)
    return m.MissionItemInt(1, 1, seq, 6, command, seq == 0, 1, 0, 0, 0, math.nan, x, y, 2.0, kind)


CORNER = [item(0, 3.0, 0.0), item(1, 3.0, 3.0)]
FENCE_ITEMS = [item(0, 50.0, 0.0, command=5003, kind=FENCE)]
RALLY_ITEMS = [item(0, 1.0, 1.0, command=5100, kind=RALLY)]


def upload(rig: Rig, items: list[m.MissionItemInt], kind: int = MISSION) -> m.MissionAck:
    rig.take(m.MissionRequestInt)
    rig.send(m.MissionCount(1, 1, len(items), kind))
    for each in items:
        asked = rig.take(m.MissionRequestInt)
        assert [(request.seq, request.mission_type) for request in asked] == [(each.seq, kind)]
        rig.send(each)
    (ack,) = rig.take(m.MissionAck)
    assert Address(ack.target_system, ack.target_component) == CLIENT
    return ack


def test_a_plan_has_an_id_in_ack_count_and_current_until_it_is_cleared() -> None:
    rig = Px4Rig()
    ids = [
        upload(rig, CORNER).opaque_id,
        upload(rig, FENCE_ITEMS, FENCE).opaque_id,
        upload(rig, RALLY_ITEMS, RALLY).opaque_id,
    ]
    assert 0 not in ids
    assert len(set(ids)) == 3
    rig.run(1.1)
    current = rig.last(m.MissionCurrent)
    assert [current.mission_id, current.fence_id, current.rally_points_id] == ids
    assert (current.total, current.mission_state, current.mission_mode) == (2, 2, 2)
    rig.send(*(m.MissionRequestList(1, 1, kind) for kind in (MISSION, FENCE, RALLY)))
    assert [count.opaque_id for count in rig.take(m.MissionCount)] == ids
    rig.send(m.MissionClearAll(1, 1, FENCE))
    assert rig.take(m.MissionAck)[0].opaque_id == 0
    rig.run(1.1)
    current = rig.last(m.MissionCurrent)
    assert [current.mission_id, current.fence_id] == [ids[0], 0]
    rig.send(m.MissionClearAll(1, 1, 255))
    rig.run(1.1)
    current = rig.last(m.MissionCurrent)
    assert (current.mission_id, current.rally_points_id) == (0, 0)
    assert (current.total, current.mission_state) == (65535, 1)


def test_mission_start_arms_and_drives_it_to_its_end() -> None:
    rig = Px4Rig()
    upload(rig, CORNER)
    assert rig.command(MavCmd.MISSION_START) == MavResult.ACCEPTED
    assert (rig.mode(), rig.autopilot.armed) == (PX4_MISSION, True)
    rig.until(lambda: "Mission Complete" in rig.texts(), limit=20.0)
    assert math.dist((3.0, 3.0), (rig.truth.north, rig.truth.east)) < 0.5
    rig.run(1.1)
    assert rig.last(m.MissionCurrent).mission_state == 5
    assert rig.mode() == PX4_HOLD
    assert [reached.seq for reached in rig.take(m.MissionItemReached)] == [0, 1]
