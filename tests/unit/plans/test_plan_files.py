"""Mission files: what each format says, and that anything else is one clear error."""

import json
import math
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.basics.errors import PlanFileError
from mav_tasks.plans import (
    FenceCircle,
    FencePolygon,
    GeoPoint,
    PlanFile,
    PlanItem,
    fence_items,
    parse_plan,
    read_plan,
)
from mav_tasks.plans.reader import MAX_ITEMS, MAX_SIZE

NAN = math.nan  # items that hold it are equal, as the reader gives this very one

#: waypoint, survey of two items, speed, jump back to the first, jump to the speed, return
PLAN = """
{
    "fileType": "Plan",
    "geoFence": {
        "circles": [
            {"circle": {"center": [47.3975676, 8.5446498], "radius": 319.85},
             "inclusion": false, "version": 1}
        ],
        "polygons": [
            {"inclusion": true, "version": 1,
             "polygon": [[47.398, 8.543], [47.399, 8.550], [47.396, 8.544], [47.395, 8.539]]},
            {"inclusion": false, "version": 1,
             "polygon": [[-47.1, -8.1], [-47.2, -8.2], [-47.3, -8.3]]}
        ],
        "breachReturn": [47.4, 8.5, 30],
        "version": 2
    },
    "groundStation": "QGroundControl",
    "mission": {
        "cruiseSpeed": 15,
        "firmwareType": 12,
        "globalPlanAltitudeMode": 1,
        "hoverSpeed": 5,
        "items": [
            {"AMSLAltAboveTerrain": null, "Altitude": 50, "AltitudeMode": 1,
             "autoContinue": true, "command": 16, "doJumpId": 1, "frame": 3,
             "params": [2.5, 0, 0, null, 47.3985099, 8.5451002, 50], "type": "SimpleItem"},
            {"TransectStyleComplexItem": {
                "CameraCalc": {"version": 2},
                "Items": [
                    {"autoContinue": true, "command": 16, "doJumpId": 2, "frame": 3,
                     "params": [0, 0, 0, null, 47.4, 8.6, 0], "type": "SimpleItem"},
                    {"autoContinue": false, "command": 206, "doJumpId": 3, "frame": 2,
                     "params": [25, 0, 1, 0, 0, 0, 0], "type": "SimpleItem"}
                ],
                "version": 2},
             "complexItemType": "survey", "type": "ComplexItem", "version": 5},
            {"autoContinue": true, "command": 178, "doJumpId": 4, "frame": 2,
             "params": [1, 1.5, -1, 0, 0, 0, 0], "type": "SimpleItem"},
            {"autoContinue": true, "command": 177, "doJumpId": 5, "frame": 2,
             "params": [1, 3, 0, 0, 0, 0, 0], "type": "SimpleItem"},
            {"autoContinue": true, "command": 177, "doJumpId": 6, "frame": 2,
             "params": [4, -1, 0, 0, 0, 0, 0], "type": "SimpleItem"},
            {"autoContinue": true, "command": 20, "doJumpId": 7, "frame": 2,
             "params": [null, null, null, null, null, null, null], "type": "SimpleItem"}
        ],
        "plannedHomePosition": [47.3977419, 8.545594, 487.989],
        "vehicleType": 10,
        "version": 2
    },
    "rallyPoints": {"points": [[47.3976040, 8.5509154, 50], [-0.1, -179.9, 0]], "version": 2},
    "version": 1
}
"""
FENCE = (
    FencePolygon(
        True,
        (
            (473980000, 85430000),
            (473990000, 85500000),
            (473960000, 85440000),
            (473950000, 85390000),
        ),
    ),
    FencePolygon(
        False, ((-471000000, -81000000), (-472000000, -82000000), (-473000000, -83000000))
    ),
    FenceCircle(False, (473975676, 85446498), 319.85),
)


def items(text: str) -> tuple[PlanItem, ...]:
    """Return items of rows: command, frame, four params, x, y, z, whether it goes on."""
    found = []
    for row in text.strip().splitlines():
        words = row.split()
        command, frame, x, y, goes_on = (int(words[column]) for column in (0, 1, 6, 7, 9))
        one, two, three, four, z = (
            NAN if w == "nan" else float(w) for w in (*words[2:6], words[8])
        )
        params = (one, two, three, four)
        found.append(PlanItem(command, frame, params, x, y, z, bool(goes_on)))
    return tuple(found)


HOME = GeoPoint(473977419, 85455940, 487.989)
READ = PlanFile(
    items("""
        16 3 2.5 0 0 nan 473985099 85451002 50 1
        16 3 0 0 0 nan 474000000 86000000 0 1
        206 2 25 0 1 0 0 0 0 0
        178 2 1 1.5 -1 0 0 0 0 1
        177 2 0 3 0 0 0 0 0 1
        177 2 3 -1 0 0 0 0 0 1
        20 2 nan nan nan nan 0 0 nan 1
    """),
    HOME,
    FENCE,
    rally=(GeoPoint(473976040, 85509154, 50.0), GeoPoint(-1000000, -1799000000, 0.0)),
)

WPL = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t47.3977419\t8.545594\t487.989\t1
1\t0\t3\t16\t2.5\t0\t0\tnan\t47.3985099\t8.5451002\t50\t1
2\t0\t3\t177\t1\t3\t0\t0\t0\t0\t0\t1
3\t0\t1\t19\t5\t0\t0\t0\t-12.34567\t0.00005\t-1\t0
"""
WPL_READ = PlanFile(
    items("""
        16 3 2.5 0 0 nan 473985099 85451002 50 1
        177 3 0 3 0 0 0 0 0 1
        19 1 5 0 0 0 -123457 0 -1 0
    """),
    HOME,
    (),
    (),
)


def changed(path: str, *value: object) -> str:
    """PLAN with another value at a path of keys and indices; without one it is taken away."""
    root = holder = json.loads(PLAN)
    *way, last = [int(key) if key.isdigit() else key for key in path.split()]
    for key in way:
        holder = holder[key]
    if value:
        holder[last] = value[0]
    else:
        del holder[last]
    return json.dumps(root)


def with_items(*items: object) -> str:
    return changed("mission items", items)


def waypoint(fields: str, *, whole: bool = True) -> dict[str, object]:
    """The first waypoint of PLAN with other fields, or those alone; "at" is its place."""
    found = json.loads(PLAN)["mission"]["items"][0] if whole else {}
    for field in fields.split("; "):
        key, _, value = field.partition(" ")
        if key == "at":
            found["params"] = [0, 0, 0, None, *json.loads(value), 0]
        elif key:
            found[key] = json.loads(value)
    return found


def pairs(text: str) -> list[list[str]]:
    """Return what stands before and after the arrow of each row."""
    return [row.strip().split(" -> ") for row in text.strip().splitlines()]


def problem(text: str) -> str:
    """What the reader says is wrong."""
    with pytest.raises(PlanFileError) as error:
        parse_plan(text)
    return str(error.value)


def line(seq: int, rest: str = "0 3 16 0 0 0 0 47 8 0 1") -> str:
    return f"{seq} {rest}\n"


def wpl(*lines: str) -> str:
    return "QGC WPL 110\n" + "".join(lines)


def test_a_plan_gives_its_items_home_fence_and_rally_points() -> None:
    assert parse_plan(PLAN) == READ
    empty = {"polygon": [], "breachReturn": [1, 2, 3], "version": 1}
    assert parse_plan(changed("geoFence", empty)).fence == ()


def test_a_text_file_gives_its_items_and_home() -> None:
    assert parse_plan(WPL) == WPL_READ


def test_marks_and_line_ends_of_other_systems_change_nothing(tmp_path: Path) -> None:
    for text, read in [(PLAN, READ), (WPL, WPL_READ)]:
        for written in (text, "\ufeff" + text, text.replace("\n", "\r\n"), "\n \n" + text):
            file = tmp_path / "of any name"
            file.write_bytes(written.encode())
            assert read_plan(file) == parse_plan(written) == read


def test_line_0_is_home_whatever_stands_in_it_and_without_one_no_line_is() -> None:
    for first in ["1 3 16 0 0 0 0 47 8 0 1", "1 0 17 0 0 0 0 47 8 0 1"]:
        jump = "0 2 177 1 3 0 0 0 0 0 1"
        plan = parse_plan(wpl(line(0, first), line(1), line(2, jump)))
        assert plan.home == (470000000, 80000000, 0.0)
        assert [item.command for item in plan.items] == [16, 177]
        assert plan.items[1].params[0] == 0.0
        plan = parse_plan(wpl(line(1, first), line(2), line(3, jump)))
        assert plan.home is None
        assert [item.command for item in plan.items][1:] == [16, 177]
        assert plan.items[2].params[0] == 0.0


def test_the_fence_as_it_is_sent() -> None:
    rows = [f"{i.command} {i.frame} {i.params[0]} {i.x} {i.y} {i.z}" for i in fence_items(READ)]
    expected = """
        5001 0 4.0 473980000 85430000 0.0
        5001 0 4.0 473990000 85500000 0.0
        5001 0 4.0 473960000 85440000 0.0
        5001 0 4.0 473950000 85390000 0.0
        5002 0 3.0 -471000000 -81000000 0.0
        5002 0 3.0 -472000000 -82000000 0.0
        5002 0 3.0 -473000000 -83000000 0.0
        5004 0 319.85 473975676 85446498 0.0
    """
    assert rows == [row.strip() for row in expected.strip().splitlines()]
    inside = PlanFile((), None, (FenceCircle(True, (1, 2), 3.0),), ())
    assert fence_items(inside) == (PlanItem(5003, 0, (3.0, 0.0, 0.0, 0.0), 1, 2, 0.0, False),)


def test_x_and_y_are_ints_in_the_unit_of_the_frame() -> None:
    for written, read in pairs("""
        frame 0; at [90, -180] -> 0 900000000 -1800000000
        frame 6; at [47.39850995, -8.00000015] -> 6 473985100 -80000002
        frame 11; at [0.00000005, 0.00000015] -> 11 0 2
        frame 1; at [214748, -214748] -> 1 2147480000 -2147480000
        frame 9; at [1.00005, -0.33333] -> 9 10000 -3333
        frame 2; at [1000, -3] -> 2 1000 -3
        frame 3; at [null, null] -> 3 0 0
    """):  # ties go to even
        item = parse_plan(with_items(waypoint(f"command 22; {written}"))).items[0]
        assert f"{item.frame} {item.x} {item.y}" == read


@given(st.decimals(-90, 90, places=12), st.floats(-180, 180))
def test_degrees_become_the_nearest_int(latitude: object, longitude: float) -> None:
    item = parse_plan(wpl(line(1, f"0 3 16 0 0 0 0 {latitude} {longitude!r} 0 1"))).items[0]
    assert item.x == round(Fraction(str(latitude)) * 10**7)
    assert item.y == round(Fraction(repr(longitude)) * 10**7)


#: files, and what is said of them
WHOLE = """
[1] -> not a plan file: line 1 is '[1]', expected JSON
QGC WPL 130 -> 'QGC WPL 130' is not supported, expected 110 or 120
{ -> not a plan file: JSON line 1 column 2: Expecting property name enclosed in double
{"a": NaN} -> not a plan file: NaN is not a JSON number
{} -> file: version is missing
{"fileType": "Parameters"} -> file: fileType "Parameters" is neither Plan nor Mission,
{"fileType": "Mission", "version": "2.0"} -> file: version "2.0" is not supported, expected
"""
#: what is changed in PLAN, or taken away from it
CHANGES = """
version = 2 -> file: version 2 is not supported, expected 1
mission = [] -> file: mission is a list, expected an object
mission items -> mission: items is missing
mission plannedHomePosition = [1, 2] -> home: a point needs 3 numbers, not 2
mission plannedHomePosition = [1, 181, 0] -> home: longitude 181 not in -180..180
geoFence polygons 1 polygon 2 -> fence polygon 2: 2 points, at least 3 are needed
geoFence polygons 0 inclusion = 1 -> fence polygon 1: inclusion is 1, expected true or false
geoFence circles 0 circle radius = 0 -> fence circle 1: radius 0 m is not above 0
geoFence circles 0 circle center = [91, 0] -> fence circle 1: latitude 91 not in -90..90
geoFence = {"polygon": [[1, 2]], "version": 1} -> fence: 1 points, at least 3 are needed
geoFence circles = {"1": 2} -> geoFence: circles is an object, expected a list
rallyPoints points 1 0 = null -> rally point 2: latitude is null, expected a number
"""
#: fields of a waypoint
FIELDS = """
type "something" -> type "something" is unknown
params [0, 0, 0, 0, 0, 0] -> 6 params, expected 7
at [91, 8] -> latitude 91 not in -90..90
at [0, -180.5] -> longitude -180.5 not in -180..180
at ["47", 8] -> param 5 is "47", expected a number
at [47, null] -> command 16 needs a place, but has none
frame 2 -> command 16 needs a place, but has none
frame 1; at [214749, 0] -> x 214749 not in -214748..214748
frame 2; command 31; at [0, 1e10] -> param 6 10000000000 not in -2147483647..
params [1e300, 0, 0, 0, 1, 1, 0] -> param 1 1e+300 is too large
frame 99 -> frame 99 is unknown
command 16.5 -> command is 16.5, expected a whole number from 0 to 65535
autoContinue 1 -> autoContinue is 1, expected true or false
doJumpId "2" -> doJumpId is "2", expected a number
"""
#: all fields of an item
ITEMS = """
JUMP; doJumpId 2; params [9, 1, 0, 0, 0, 0, 0] -> jumps to 9, which is not an item
JUMP; doJumpId 2; params [null, 1, 0, 0, 0, 0, 0] -> jumps to nan, which is not an item
JUMP; doJumpId 1; params [1, 3, 0, 0, 0, 0, 0] -> jumps to 1, which is several items
COMPLEX "fwLandingPattern"; landCoordinate [1, 2, 3] -> \
complex item "fwLandingPattern" does not contain its items
COMPLEX "survey"; TransectStyleComplexItem {"Items": []} -> \
complex item "survey" does not contain its items
""".replace("JUMP", 'type "SimpleItem"; autoContinue true; command 177; frame 2').replace(
    "COMPLEX", 'type "ComplexItem"; complexItemType'
)
#: lines of a text file; line 0 is home
LINES = """
1 0 3 16 0 0 0 0 1.047,5 8 0 1 -> 1.047,5 is not a number: decimal comma? Write 1047.5
1 0 3 16 0 0 0 0 4_7 8 0 1 -> 4_7 is not a number: write it with the digits 0 to 9 and a point
1.5 0 3 16 0 0 0 0 4 8 0 1 -> the number of the line is 1.5, expected a whole number from
1 0 3 16 0 0 0 0 147 8 0 1 -> latitude 147 not in -90..90
1 0 3 16 0 0 0 0 nan nan 0 1 -> command 16 needs a place, but has none
1 0 3 16 inf 0 0 0 47 8 0 1 -> param 1 inf is too large
1 0 3 16 0 0 0 0 47 8 0 2 -> autocontinue is 2, expected a whole number from 0 to 1
1 0 3 177 0 1 0 0 0 0 0 1 -> jumps to 0, which is not an item
1 0 3 177 2 1 0 0 0 0 0 1 -> jumps to 2, which is not an item
"""


def test_an_error_names_the_part_of_the_file() -> None:
    assert problem("").startswith("not a plan file: it is empty")
    assert problem('{"a": ' + "[" * 100_000).startswith("not a plan file: JSON nested too deep")
    nested = '{"fileType": ' + "[" * 400 + "]" * 400 + "}"
    assert problem(nested).startswith("file: fileType is a list, expected text")
    for text, words in pairs(WHOLE):
        assert problem(text).startswith(words)
    for change, words in pairs(CHANGES):
        path, _, value = change.partition(" = ")
        assert problem(changed(path, *map(json.loads, [value] if value else []))).startswith(words)


def test_an_error_names_the_item() -> None:
    wrong: list[tuple[object, str]] = [
        (None, "it is null, expected an object"),
        ({}, "type is missing"),
    ]
    wrong += [(waypoint(fields), words) for fields, words in pairs(FIELDS)]
    wrong += [(waypoint(fields, whole=False), words) for fields, words in pairs(ITEMS)]
    for item, words in wrong:
        assert problem(with_items(waypoint(""), item)).startswith(f"item 2: {words}"), item


def test_an_error_names_the_line() -> None:
    for words_of_line, words in pairs(LINES):
        text = wpl(
            line(0, "1 0 16 0 0 0 0 47 8 0 1"), "# a comment counts as a line\n", words_of_line
        )
        assert problem(text).startswith(f"line 4: {words}")


def test_a_file_that_cannot_be_read_is_such_an_error(tmp_path: Path) -> None:
    missing = tmp_path / "missing.plan"
    with pytest.raises(PlanFileError, match=r"missing\.plan: No such file"):
        read_plan(missing)
    with pytest.raises(PlanFileError, match="Is a directory"):
        read_plan(tmp_path)


def test_size_and_number_are_limited(tmp_path: Path) -> None:
    big = tmp_path / "big"
    big.write_bytes(PLAN.encode() + b" " * (MAX_SIZE - len(PLAN)))
    assert read_plan(big) == READ
    big.write_bytes(PLAN.encode() + b" " * (MAX_SIZE - len(PLAN) + 1))
    with pytest.raises(PlanFileError, match=r"big: more than 10000000 bytes$"):
        read_plan(big)
    assert problem(PLAN + " " * MAX_SIZE) == "more than 10000000 characters"
    rally = [[1, 2, 3]] * (MAX_ITEMS + 1)
    many = changed("rallyPoints points", rally)
    assert problem(many) == "more than 65534 rally points"
    corners = [[1, 2]] * MAX_ITEMS
    fenced = changed("geoFence polygons 0 polygon", corners)
    assert problem(fenced) == "more than 65534 fence items"
    assert problem(wpl(*map(line, range(1, MAX_ITEMS + 2)))) == "more than 65534 mission items"
