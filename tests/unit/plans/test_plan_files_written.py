"""Mission files as they are written: they read back as the same items, not only by ourselves."""

import json
import math
import struct
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink import mavwp

from mav_tasks.basics.errors import PlanFileError
from mav_tasks.plans import (
    FenceCircle,
    FencePolygon,
    GeoPoint,
    PlanFile,
    PlanItem,
    fence_items,
    fence_of,
    format_plan,
    format_wpl,
    mission_of,
    parse_plan,
    read_plan,
    write_plan,
)

NAN = math.nan
PLACE = (473985099, 85451002)
ITEMS = (
    PlanItem(16, 3, (2.5, 0.0, 0.0, NAN), *PLACE, 50.0, True),
    PlanItem(178, 2, (1.0, 1.5, -1.0, 0.0), 0, 0, 0.0, True),
    PlanItem(16, 1, (0.0, 0.0, 0.0, 0.0), 12345, -5, -1.0, False),
    PlanItem(177, 2, (0.0, 3.0, 0.0, 0.0), 0, 0, 0.0, True),
    PlanItem(54000, 2, (2.0, 0.3, 0.0, 0.0), 0, 0, 0.0, True),
    PlanItem(20, 2, (NAN, NAN, NAN, NAN), 0, 0, NAN, True),
)
HOME = GeoPoint(473977419, 85455940, 487.989)
FENCE = (
    FencePolygon(True, ((473980000, 85430000), (473990000, 85500000), (473960000, 85440000))),
    FenceCircle(False, (-473975676, 85446498), 319.5),
    FencePolygon(False, ((1, -1), (2, -2), (3, -3), (4, -4))),
)

#: not of a mission in a text file: jumps by number, fences, rally points
NOT_OF_A_MISSION = (177, 5000, 5001, 5002, 5003, 5004, 5100)
floats = st.floats(-(2.0**127), 2.0**127, width=32) | st.just(NAN)
items = st.builds(
    PlanItem,
    st.integers(0, 65535).filter(lambda command: command not in NOT_OF_A_MISSION),
    st.sampled_from([0, 1, 3, 6]),
    st.tuples(floats, floats, floats, floats),
    st.integers(-90 * 10**7, 90 * 10**7),
    st.integers(-180 * 10**7, 180 * 10**7),
    floats,
    st.booleans(),
)


def on_the_wire(item: PlanItem) -> tuple[object, ...]:
    """What of an item is sent: floats have 32 bits there."""
    whole = (item.command, item.frame, item.x, item.y, item.autocontinue)
    return (*whole, *bits(*item.params, item.z))


def bits(*values: float) -> list[bytes]:
    return [struct.pack("<f", NAN if math.isnan(value) else value) for value in values]


@pytest.mark.parametrize("written", [format_plan, format_wpl])
@given(items=st.lists(items, min_size=1, max_size=4))
def test_any_mission_reads_back_bit_by_bit(written: object, items: list[PlanItem]) -> None:
    assert callable(written)
    read = parse_plan(written(PlanFile(tuple(items), HOME, (), ())))
    assert [on_the_wire(item) for item in read.items] == [on_the_wire(item) for item in items]
    assert read.home == HOME


def test_a_text_file_means_the_same_to_another_implementation(tmp_path: Path) -> None:
    file = tmp_path / "way.waypoints"
    write_plan(PlanFile(ITEMS, HOME, (), ()), file)
    theirs = mavwp.MAVWPLoader()
    assert theirs.load(str(file)) == len(ITEMS) + 1
    home = theirs.wp(0)
    assert (round(home.x * 1e7), round(home.y * 1e7), home.z) == HOME
    assert (home.command, home.frame, home.current) == (16, 0, 1)
    for number, item in enumerate(ITEMS, 1):
        other = theirs.wp(number)
        scale = {1: 1e4, 2: 1, 3: 1e7}[item.frame]
        assert (other.seq, other.command, other.frame) == (number, item.command, item.frame)
        assert (round(other.x * scale), round(other.y * scale)) == (item.x, item.y)
        assert bool(other.autocontinue) == item.autocontinue
        first = item.params[0] + (item.command == 177)  # a jump counts home
        params = (first, *item.params[1:], item.z)
        read = (other.param1, other.param2, other.param3, other.param4, other.z)
        assert bits(*read) == bits(*params)


def test_what_a_planner_needs_besides_is_there() -> None:
    root = json.loads(format_plan(PlanFile(ITEMS, None, (), ())))
    assert (root["fileType"], root["version"], root["mission"]["version"]) == ("Plan", 1, 2)
    assert root["mission"]["plannedHomePosition"] == [47.3985099, 8.5451002, 0.0]  # the first place
    assert {"firmwareType", "vehicleType", "cruiseSpeed", "hoverSpeed"} < set(root["mission"])
    assert [item["doJumpId"] for item in root["mission"]["items"]] == [1, 2, 3, 4, 5, 6]
    assert (root["geoFence"]["version"], root["rallyPoints"]["version"]) == (2, 2)


def test_a_fence_and_rally_points_read_back_as_they_were(tmp_path: Path) -> None:
    plan = PlanFile((), HOME, FENCE, (GeoPoint(473976040, 85509154, 50.0),))
    write_plan(plan, tmp_path / "fence.plan")
    read = read_plan(tmp_path / "fence.plan")
    polygons_first = (FENCE[0], FENCE[2], FENCE[1])  # a file has them in two lists
    assert read == replace(plan, fence=polygons_first)
    with pytest.raises(PlanFileError, match=r"\.plan"):
        write_plan(plan, tmp_path / "fence.waypoints")


def test_a_fence_as_it_was_sent_is_the_fence() -> None:
    sent = fence_items(PlanFile((), None, FENCE, ()))
    back = PlanItem(5000, 0, (0.0, 0.0, 0.0, 0.0), 1, 2, 0.0, False)
    assert fence_of((*sent, back)).fence == FENCE
    assert fence_of(()) == mission_of((), has_home_item=True) == PlanFile((), None, (), ())
    with pytest.raises(PlanFileError, match="groups"):
        fence_of([replace(item, params=(item.params[0], 1.0, 0.0, 0.0)) for item in sent])
    with pytest.raises(PlanFileError, match="item 16"):
        fence_of(ITEMS[:1])


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(PlanFileError, match="no/way"):
        write_plan(PlanFile(ITEMS, None, (), ()), tmp_path / "no/way.plan")
