"""Mission, fence and rally files as people have them: what is odd in each, with places of ours.

Each was found in public: in repositories of autopilots, ground stations and their users, and in
their issues. What is odd is kept, all else is new.
"""

import json
from typing import Any, NamedTuple


class Found(NamedTuple):
    """A file: what it holds (items, zones of the fence, rally points), or why it is refused."""

    name: str
    odd: str
    data: bytes
    holds: tuple[int, int, int] | None
    words: str = ""

    @property
    def text(self) -> str:
        """The file as the page sends it."""
        wide = self.data.startswith((b"\xff\xfe", b"\xfe\xff"))
        return self.data.decode("utf-16" if wide else "utf-8", "replace")


HOME = "0 1 0 16 0 0 0 0 61.4981000 23.7610000 95.000000 1"
FIRST = "1 0 3 16 0.000000 0.000000 0.000000 0.000000 61.4982000 23.7612000 0.000000 1"
SECOND = "2 0 3 16 0.000000 0.000000 0.000000 0.000000 61.4983000 23.7614000 0.000000 1"
PLACES = (("61.4981", "23.7610"), ("61.4989", "23.7610"), ("61.4989", "23.7625"))
RING = (*PLACES, PLACES[0])


def text(*lines: str, head: str = "QGC WPL 110", end: str = "\n") -> bytes:
    """Return a text with tabs between its fields."""
    rows = [line if "#" in line or "\t" in line else "\t".join(line.split(" ")) for line in lines]
    return "".join(row + end for row in ([head] if head else []) + rows).encode()


def simple(command: int, number: int, **more: Any) -> dict[str, Any]:
    """Return an item of QGroundControl's JSON up to 2017, with its place apart."""
    place = {"coordinate": [61.4982, 23.7612, 0], "type": "SimpleItem", "doJumpId": number}
    item = {"autoContinue": True, "command": command, "frame": 3, "params": [0, 0, 0, None]}
    return item | place | more


def plan(**parts: Any) -> bytes:
    """Return a .plan file."""
    root = {"fileType": "Plan", "groundStation": "QGroundControl", "version": 1} | parts
    return json.dumps(root, indent=4).encode()


OLDEST = {
    "MAV_AUTOPILOT": 3,
    "complexItems": [],
    "groundStation": "QGroundControl",
    "items": [
        {key: value for key, value in simple(16, 1).items() if key not in ("params", "doJumpId")}
        | {"id": 1, "type": "missionItem", "param1": 0, "param2": 0, "param3": 0, "param4": 0}
    ],
    "plannedHomePosition": {"coordinate": [61.4981, 23.761, 95], "type": "missionItem"},
    "version": "1.0",
}
CORNERS = [[61.4981, 23.761], [61.4989, 23.761], [61.4989, 23.7625]]
SCAN = {"type": "ComplexItem", "complexItemType": "StructureScan", "version": 2}


def fence(number: int, command: int, size: str, place: tuple[str, str]) -> str:
    return f"{number} 0 3 {command} {size} 0 0 0 {place[0]} {place[1]} 0 1"


FILES = (
    # Mission Planner
    Found("home set", "CRLF", text(HOME, FIRST, SECOND, end="\r\n"), (2, 0, 0)),
    Found("home unset", "home is command 0", text("0 1 0 0 0 0 0 0 0 0 0 1", FIRST), (1, 0, 0)),
    Found("terrain", "frame 10", text(HOME, FIRST.replace("0 3 16", "0 10 16")), (1, 0, 0)),
    Found("home alone", "no mission", text(HOME), (0, 0, 0)),
    Found("a jump", "counts home", text(HOME, FIRST, "2 0 3 177 1 3 0 0 0 0 0 1"), (2, 0, 0)),
    Found("Notepad", "UTF-8 mark", b"\xef\xbb\xbf" + text(HOME, FIRST, end="\r\n"), (1, 0, 0)),
    Found("Unicode", "UTF-16", text(HOME, FIRST, end="\r\n").decode().encode("utf-16"), (1, 0, 0)),
    Found("umlaut", "Latin-1 comment", text(HOME, FIRST) + b"# H\xfctte\n", (1, 0, 0)),
    Found("DOS", "ends with Ctrl-Z", text(HOME, FIRST, end="\r\n") + b"\x1a", (1, 0, 0)),
    # MAVProxy, and what people make with its tools
    Found(
        "frame of home",
        "home is relative",
        text(HOME.replace("1 0 16", "0 3 16"), FIRST),
        (1, 0, 0),
    ),
    Found("a gap", "lines 0, 1, 2, 4", text(HOME, FIRST, SECOND, "4" + SECOND[1:]), (3, 0, 0)),
    Found(
        "copied lines and a jump",
        "which line does it mean?",
        text(HOME, FIRST, "2 0 3 177 1 3 0 0 0 0 0 1", FIRST),
        None,
        "line 5: numbered 1, expected 3: number the lines one after the other, for line 4 jumps",
    ),
    Found("comment", "behind a line", text(HOME, FIRST + " # gate"), (1, 0, 0)),
    Found("comment first", "before QGC WPL", b"# mine\n\n" + text(HOME, FIRST), (1, 0, 0)),
    Found("blanks", "no tabs", text(HOME, FIRST).replace(b"\t", b"   "), (1, 0, 0)),
    Found("Mac", "CR", text(HOME, FIRST, end="\r"), (1, 0, 0)),
    Found("cut", "no end of line", text(HOME, FIRST).rstrip(), (1, 0, 0)),
    Found("not given", "nan", text(HOME, FIRST.replace("0.000000", "nan")), (1, 0, 0)),
    Found(
        "no first line",
        "QGC WPL is missing",
        text(HOME, FIRST, head=""),
        None,
        "line 1: a mission, but its first line is missing: add 'QGC WPL 110'",
    ),
    Found(
        "a column more",
        "13 fields",
        text(HOME, FIRST + " 0"),
        None,
        "line 3: 13 fields, expected 12 (number, current, frame, command, seven parameters,",
    ),
    Found(
        "spreadsheet",
        "commas between fields",
        text(HOME.replace(" ", ",")),
        None,
        "line 2: separated by commas: separate the fields by tabs",
    ),
    Found("protobuf", "QGC WPL PB 110", text("a {", head="QGC WPL PB 110"), None, "(wp save)"),
    Found("2010", "QGC WPL 100", text("0 3 16", head="QGC WPL 100"), None, "is a format of 2010"),
    # QGroundControl, text
    Found(
        "numbered from 1",
        "no home",
        text("1 0 3 178 1 5 -1 0 0 0 0 1", SECOND, "3" + SECOND[1:]),
        (3, 0, 0),
    ),
    Found(
        "other locale",
        "decimal commas",
        text("1 0 3 178 1 5 -1 0 0 0 0 1", SECOND.replace(".", ",")),
        None,
        "line 3: 0,000000 is not a number: decimal comma? Write 0.000000",
    ),
    Found("PX4", "120: no home", text("0" + FIRST[1:], FIRST, head="QGC WPL 120"), (2, 0, 0)),
    Found(
        "drone of a toy maker",
        "two tabs",
        text("0\t0\t3\t178\t\t0\t1\t-1\t0\t0\t0\t0\t1", head="QGC WPL 120"),
        (1, 0, 0),
    ),
    Found("2015", "items without a command", text(HOME, "1 0 3 0 0 0 0 0 0 0 0 0"), (1, 0, 0)),
    # QGroundControl, JSON
    Found("old.mission", "no type, one key a parameter", json.dumps(OLDEST).encode(), (1, 0, 0)),
    Found(
        "old survey.mission",
        "complexItems",
        json.dumps(OLDEST | {"complexItems": [{"id": 2, "type": "survey"}]}).encode(),
        None,
        "complexItems: a survey does not contain its items: if a newer QGroundControl",
    ),
    Found(
        "2016.mission",
        "not in a .plan",
        plan(fileType="Mission", version=2, items=[simple(22, 1), simple(16, 2)]),
        (2, 0, 0),
    ),
    Found(
        "2017.plan",
        "places apart, fence of version 1",
        plan(
            mission={"items": [simple(16, 1)], "version": 2},
            geoFence={"polygon": CORNERS, "version": 1},
            rallyPoints={"points": [], "version": 1},
        ),
        (1, 1, 0),
    ),
    Found(
        "a user's.plan",
        "is called Mission",
        plan(fileType="Mission", mission={"items": [simple(16, 1)], "version": 2}),
        (1, 0, 0),
    ),
    Found(
        "scan.plan",
        "no items in it",
        plan(mission={"items": [simple(16, 1), SCAN], "version": 2}),
        None,
        'item 2: complex item "StructureScan" does not contain its items: if a newer',
    ),
    Found(
        "numbers as texts.plan",
        "made by a script",
        plan(mission={"items": [simple(16, 1, coordinate=["61.4", "23.7", "0"])], "version": 2}),
        None,
        'item 1: param 5 is "61.4", expected a number',
    ),
    Found(
        "old.fence",
        "with parameters",
        plan(fileType="GeoFence", parameters=[{"name": "FENCE_ACTION"}], polygon=CORNERS),
        (0, 1, 0),
    ),
    Found("old.rally", "", plan(fileType="RallyPoints", points=[[61.4981, 23.761, 5]]), (0, 0, 1)),
    # fences
    Found(
        "mavproxy.fen",
        "first where to return to",
        text("61.4984 23.7615", *map(" ".join, RING), head=""),
        (0, 1, 0),
    ),
    Found(
        "planner.fen",
        "blanks, CRLF, a comment",
        b"#saved by APM Planner 1.3\r\n61.4984 23.7615\r\n"
        + "".join(f"{x} {y}\r\n" for x, y in RING).encode(),
        (0, 1, 0),
    ),
    Found("area.poly", "nowhere to return to", text(*map(" ".join, RING), head=""), (0, 1, 0)),
    Found(
        "open.fen",
        "not closed",
        text("61.4984 23.7615", *map(" ".join, PLACES), head=""),
        None,
        "line 4: a fence has a line to return to, at least 3 corners, and ends with the first",
    ),
    Found(
        "commas.fen",
        "decimal commas",
        text(*(" ".join(each).replace(".", ",") for each in RING), head=""),
        None,
        "line 1: 61,4981 is not a number: decimal comma? Write 61.4981",
    ),
    Found(
        "fence.waypoints",
        "home, return point, polygon, circle",
        text(
            HOME,
            fence(1, 5000, "0", PLACES[0]),
            *(fence(number, 5001, "3", place) for number, place in enumerate(PLACES, 2)),
            fence(5, 5004, "2.5", PLACES[1]),
        ),
        (0, 2, 0),
    ),
    Found(
        "fence.txt",
        "numbered from 0, no home",
        text(*(fence(number, 5002, "3", place) for number, place in enumerate(PLACES))),
        (0, 1, 0),
    ),
    Found(
        "corners.waypoints",
        "one was deleted",
        text(HOME, fence(1, 5001, "3", PLACES[0]), fence(2, 5001, "3", PLACES[1])),
        None,
        "line 3: a fence of 3 corners of which 2 follow; at least 3, and as many as param 1",
    ),
    # rally points
    Found("mavproxy.ral", "RALLY and a blank", b"RALLY 61.4981\t23.761\t0\t40\t0\t0\n", (0, 0, 1)),
    Found("rally.waypoints", "as a mission", text(HOME, fence(1, 5100, "0", PLACES[0])), (0, 0, 1)),
    # other files of the same folders
    Found(
        "rover.param", "parameters", b"WP_SPEED,2\n", None, "line 1 is 'WP_SPEED,2', expected JSON"
    ),
    Found("track.kml", "KML", b"<?xml version='1.0'?>\n<kml/>", None, "a fence (latitude and"),
    Found("nothing.txt", "empty", b"\r\n", None, "not a plan file: it is empty"),
)
