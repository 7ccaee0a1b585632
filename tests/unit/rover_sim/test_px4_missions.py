"""Missions, fences and rally points as PX4 takes, names, gives back and drives them."""

import math

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavMissionResult, MavResult
from rover_sim.geo import DEFAULT_ORIGIN
from tests.unit.rover_sim.rig import CLIENT, PX4_HOLD, PX4_MISSION, Px4Rig

OTHER_CLIENT = Address(255, 190)
MISSION, FENCE, RALLY = 0, 1, 2


def item(
    seq: int, north: float = 0.0, east: float = 0.0, *, command: int = 16, kind: int = MISSION
) -> m.MissionItemInt:
    x, y = DEFAULT_ORIGIN.to_global(north, east)
    return m.MissionItemInt(1, 1, seq, 6, command, seq == 0, 1, 0, 0, 0, math.nan, x, y, 2.0, kind)


CORNER = [item(0, 3.0, 0.0), item(1, 3.0, 3.0)]
FENCE_ITEMS = [item(0, 50.0, 0.0, command=5003, kind=FENCE)]
RALLY_ITEMS = [item(0, 1.0, 1.0, command=5100, kind=RALLY)]


def upload(rig: Px4Rig, items: list[m.MissionItemInt], kind: int = MISSION) -> m.MissionAck:
    rig.take(m.MissionRequestInt)
    rig.send(m.MissionCount(1, 1, len(items), kind))
    for each in items:
        asked = rig.take(m.MissionRequestInt)
        assert [(request.seq, request.mission_type) for request in asked] == [(each.seq, kind)]
        rig.send(each)
    (ack,) = rig.take(m.MissionAck)
    assert Address(ack.target_system, ack.target_component) == CLIENT
    return ack


def test_every_item_comes_back_as_it_was_the_first_one_too() -> None:
    rig = Px4Rig()
    upload(rig, CORNER)
    rig.send(*(m.MissionRequestInt(1, 1, seq) for seq in range(2)))
    first, second = rig.take(m.MissionItemInt)
    assert (first.x, first.y) == DEFAULT_ORIGIN.to_global(3.0, 0.0)
    assert (second.frame, second.command, second.z) == (6, 16, 2.0)
    assert math.isnan(second.param4)


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


def test_the_same_plan_has_the_same_id_and_another_has_another() -> None:
    rig = Px4Rig()
    first = upload(rig, CORNER).opaque_id
    assert upload(rig, [item(0, 3.0, 0.0), item(1, 3.0, 4.0)]).opaque_id != first
    assert upload(rig, CORNER).opaque_id == first


def test_a_silent_sender_is_asked_some_four_times_a_second_and_given_up_after_five() -> None:
    rig = Px4Rig()
    rig.send(m.MissionCount(1, 1, 2))
    rig.take(m.MissionRequestInt)
    rig.run(4.9)
    asked = [request.seq for request in rig.take(m.MissionRequestInt)]
    assert asked == [0] * len(asked)
    assert 16 <= len(asked) <= 20  # whole control periods between them
    rig.run(1.0)
    assert "Operation timeout" in rig.texts()
    assert rig.take(m.MissionAck) == []
    assert upload(rig, CORNER).type == MavMissionResult.ACCEPTED


def test_an_item_out_of_turn_is_passed_over_and_the_last_one_again_is_acked_again() -> None:
    rig = Px4Rig()
    rig.send(m.MissionCount(1, 1, 2), CORNER[1])
    assert rig.take(m.MissionAck) == []
    rig.send(*CORNER)
    (ack,) = rig.take(m.MissionAck)
    rig.send(CORNER[1])
    (again,) = rig.take(m.MissionAck)
    assert (again.type, again.opaque_id) == (MavMissionResult.ACCEPTED, ack.opaque_id)
    rig.send(CORNER[0])
    assert rig.take(m.MissionAck)[0].type == MavMissionResult.ERROR


def test_a_second_client_gets_an_error_and_the_first_goes_on() -> None:
    rig = Px4Rig()
    rig.send(m.MissionCount(1, 1, 1))
    rig.take(m.MissionRequestInt)
    rig.send_from(OTHER_CLIENT, m.MissionCount(1, 1, 5))
    (refused,) = rig.take(m.MissionAck)
    assert (refused.type, refused.target_system) == (MavMissionResult.ERROR, 255)
    rig.send(CORNER[0])
    assert rig.take(m.MissionAck)[0].type == MavMissionResult.ACCEPTED


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


def test_it_goes_on_where_it_was_left() -> None:
    rig = Px4Rig()
    upload(rig, CORNER)
    rig.command(MavCmd.MISSION_START)
    rig.until(lambda: any(isinstance(x, m.MissionItemReached) for x in rig.heard), limit=10.0)
    rig.set_mode(PX4_HOLD)
    rig.run(1.1)
    paused = rig.last(m.MissionCurrent)
    assert (paused.seq, paused.mission_state, paused.mission_mode) == (1, 4, 2)
    rig.take(m.MissionItemReached)
    rig.set_mode(PX4_MISSION)
    rig.run(10.0)
    assert [reached.seq for reached in rig.take(m.MissionItemReached)] == [1]


def test_a_finished_mission_begins_anew_and_a_new_one_is_not_finished() -> None:
    rig = Px4Rig()
    upload(rig, CORNER)
    rig.command(MavCmd.MISSION_START)
    rig.until(lambda: "Mission Complete" in rig.texts(), limit=20.0)
    rig.run(0.1)
    rig.take(m.MissionItemReached)
    assert rig.set_mode(PX4_MISSION) == MavResult.ACCEPTED
    rig.until(lambda: "Mission Complete" in rig.texts(), limit=20.0)
    assert [reached.seq for reached in rig.take(m.MissionItemReached)] == [0, 1]
    rig.run(0.1)
    upload(rig, CORNER)
    rig.run(1.1)
    assert rig.last(m.MissionCurrent).mission_state == 2


def test_a_mission_cleared_while_it_drives_ends_in_hold() -> None:
    rig = Px4Rig()
    upload(rig, CORNER)
    rig.command(MavCmd.MISSION_START)
    rig.run(2.0)
    rig.send(m.MissionClearAll(1, 1, 0))
    rig.run(3.0)
    assert (rig.mode(), rig.truth.forward_speed) == (PX4_HOLD, 0.0)


@pytest.mark.parametrize("first", [-2.0, 2.0, math.nan])
def test_mission_start_at_no_item_is_denied(first: float) -> None:
    rig = Px4Rig()
    upload(rig, CORNER)
    assert rig.command(MavCmd.MISSION_START, first) == MavResult.DENIED
    assert rig.mode() == PX4_HOLD


def test_arming_in_a_mission_that_is_gone_is_refused() -> None:
    rig = Px4Rig()
    upload(rig, CORNER)
    assert rig.set_mode(PX4_MISSION) == MavResult.ACCEPTED
    rig.send(m.MissionClearAll(1, 1, 255))
    assert rig.arm() == MavResult.TEMPORARILY_REJECTED
    assert rig.texts()[-1] == "Arming denied: Mission cannot run"


def test_set_current_is_answered_in_any_mode_and_kept() -> None:
    rig = Px4Rig()
    upload(rig, CORNER)
    rig.send(m.MissionSetCurrent(1, 1, 1))
    assert rig.take(m.MissionCurrent)[-1].seq == 1
    rig.send(m.MissionSetCurrent(1, 1, 2))
    assert rig.texts()[-1] == "WPM: WP CURR CMD: Not in list"
    assert rig.take(m.MissionCurrent)[-1].seq == 1
