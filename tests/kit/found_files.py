"""Mission, fence and rally files as people have them: what is odd in each, with places of ours.

Each was found in public: in repositories of autopilots, ground stations and their users, and in
their issues. What is odd is kept, all else is new.
"""

import re
from typing import NamedTuple


class Found(NamedTuple):
    """A file: what it holds (items, zones of the fence, rally points), or why it is refused."""

    name: str
    odd: str
    data: bytes
    holds: tuple[int, ...] | None
    words: str = ""

    @property
    def text(self) -> str:
        """The file as the page sends it."""
        wide = self.data.startswith((b"\xff\xfe", b"\xfe\xff"))
        return self.data.decode("utf-16" if wide else "utf-8", "replace")


#: words in the files below that stand for a line or a part of one; an ITEM of QGroundControl's JSON
#: up to 2017 has its PLACE apart
SHORT = dict(
    row.split(": ", 1)
    for row in """HOME: 0 1 0 16 0 0 0 0 61.4981000 23.7610000 95.000000 1
FIRST: 1 0 3 16 ZEROS 61.4982000 23.7612000 0.000000 1
SECOND: 2 0 3 16 ZEROS THERE
ZEROS: 0.000000 0.000000 0.000000 0.000000
THERE: 61.4983000 23.7614000 0.000000 1
JUMP: 2 0 3 177 1 3 0 0 0 0 0 1
SPEED: 1 0 3 178 1 5 -1 0 0 0 0 1
OF: "groundStation": "QGroundControl", "version"
ITEM: {"command": 16, "doJumpId": 1, MORE, PLACE}
MORE: "autoContinue": true, "frame": 3, "params": [0, 0, 0, null], "type": "SimpleItem"
PLACE: "coordinate": [61.4982, 23.7612, 0]
CORNERS: [[61.4981, 23.761], [61.4989, 23.761], [61.4989, 23.7625]]
OLD: "autoContinue": true, "frame": 3, "id": 1, "type": "missionItem", PARAMS, PLACE
PARAMS: "param1": 0, "param2": 0, "param3": 0, "param4": 0
OLDEST: "MAV_AUTOPILOT": 3, OF: "1.0", "items": [{"command": 16, OLD}], OLDHOME
OLDHOME: "plannedHomePosition": {"coordinate": [61.4981, 23.761, 95], "type": "missionItem"}
SCAN: {"type": "ComplexItem", "complexItemType": "StructureScan", "version": 2}""".splitlines()
)


def found(block: str) -> Found:
    """Read a file of the text below: its name, what is odd, what is said, how it is written."""
    head, *lines = block.split("\n")
    name, odd, said, *rest = head.split(" | ")
    how = rest[0].split() if rest else []
    end = "\r\n" if "CRLF" in how else "\r" if "CR" in how else "\n"
    blank = "   " if "blanks" in how else "\t"
    data = ""
    for line in lines:
        while line != (longer := re.sub(r"\b[A-Z]+\b", lambda w: SHORT.get(w[0], w[0]), line)):
            line = longer
        if line[:1].isdigit() and "#" not in line:
            line = line.replace(" ", blank)
        data += line + end
    coding = ([word for word in how if "-" in word] or ["utf-8"])[0]
    data = data.removesuffix(end) if "cut" in how else data
    is_read = re.fullmatch(r"\d \d \d", said)
    holds = tuple(map(int, said.split())) if is_read else None
    return Found(name, odd, data.encode(coding), holds, "" if is_read else said)


#: "== name | what is odd | what it holds or why it is refused | how it is written", then its lines,
#: where blanks are tabs if the line begins with a number and has no comment
TEXT = """
-- Mission Planner
== home set | CRLF | 2 0 0 | CRLF
QGC WPL 110
HOME
FIRST
SECOND
== home unset | home is command 0 | 1 0 0
QGC WPL 110
0 1 0 0 0 0 0 0 0 0 0 1
FIRST
== terrain | frame 10 | 1 0 0
QGC WPL 110
HOME
1 0 10 16 ZEROS 61.4982000 23.7612000 0.000000 1
== home alone | no mission | 0 0 0
QGC WPL 110
HOME
== a jump | counts home | 2 0 0
QGC WPL 110
HOME
FIRST
JUMP
== Notepad | UTF-8 mark | 1 0 0 | CRLF utf-8-sig
QGC WPL 110
HOME
FIRST
== Unicode | UTF-16 | 1 0 0 | CRLF utf-16
QGC WPL 110
HOME
FIRST
== umlaut | Latin-1 comment | 1 0 0 | latin-1
QGC WPL 110
HOME
FIRST
# Hütte
== DOS | ends with Ctrl-Z | 1 0 0 | CRLF cut
QGC WPL 110
HOME
FIRST
\x1a
-- MAVProxy, and what people make with its tools
== frame of home | home is relative | 1 0 0
QGC WPL 110
0 0 3 16 0 0 0 0 61.4981000 23.7610000 95.000000 1
FIRST
== a gap | lines 0, 1, 2, 4 | 3 0 0
QGC WPL 110
HOME
FIRST
SECOND
4 0 3 16 ZEROS THERE
== copied lines and a jump | which line does it mean? | \
line 5: numbered 1, expected 3: number the lines one after the other, for line 4 jumps
QGC WPL 110
HOME
FIRST
JUMP
FIRST
== comment | behind a line | 1 0 0
QGC WPL 110
HOME
FIRST # gate
== comment first | before QGC WPL | 1 0 0
# mine

QGC WPL 110
HOME
FIRST
== blanks | no tabs | 1 0 0 | blanks
QGC WPL 110
HOME
FIRST
== Mac | CR | 1 0 0 | CR
QGC WPL 110
HOME
FIRST
== cut | no end of line | 1 0 0 | cut
QGC WPL 110
HOME
FIRST
== not given | nan | 1 0 0
QGC WPL 110
HOME
1 0 3 16 nan nan nan nan 61.4982000 23.7612000 nan 1
== no first line | QGC WPL is missing | \
line 1: a mission, but its first line is missing: add 'QGC WPL 110'
HOME
FIRST
== a column more | 13 fields | \
line 3: 13 fields, expected 12 (number, current, frame, command, seven parameters,
QGC WPL 110
HOME
FIRST 0
== spreadsheet | commas between fields | line 2: separated by commas: separate the fields by tabs
QGC WPL 110
0,1,0,16,0,0,0,0,61.4981000,23.7610000,95.000000,1
== protobuf | QGC WPL PB 110 | (wp save)
QGC WPL PB 110
a {
== 2010 | QGC WPL 100 | is a format of 2010
QGC WPL 100
0 3 16
-- QGroundControl, text
== numbered from 1 | no home | 3 0 0
QGC WPL 110
SPEED
SECOND
3 0 3 16 ZEROS THERE
== other locale | decimal commas | \
line 3: 0,000000 is not a number: decimal comma? Write 0.000000
QGC WPL 110
SPEED
2 0 3 16 0,000000 0,000000 0,000000 0,000000 61,4983000 23,7614000 0,000000 1
== PX4 | 120: no home | 2 0 0
QGC WPL 120
0 0 3 16 ZEROS 61.4982000 23.7612000 0.000000 1
FIRST
== drone of a toy maker | two tabs | 1 0 0
QGC WPL 120
0 0 3 178\t\t0 1 -1 0 0 0 0 1
== 2015 | items without a command | 1 0 0
QGC WPL 110
HOME
1 0 3 0 0 0 0 0 0 0 0 0
-- QGroundControl, JSON
== old.mission | no type, one key a parameter | 1 0 0
{OLDEST, "complexItems": []}
== old survey.mission | complexItems | \
complexItems: a survey does not contain its items: if a newer QGroundControl
{OLDEST, "complexItems": [{"id": 2, "type": "survey"}]}
== 2016.mission | not in a .plan | 2 0 0
{"fileType": "Mission", OF: 2, "items": [{"command": 22, "doJumpId": 1, MORE, PLACE},
    {"command": 16, "doJumpId": 2, MORE, PLACE}]}
== 2017.plan | places apart, fence of version 1 | 1 1 0
{"fileType": "Plan", OF: 1, "mission": {"items": [ITEM], "version": 2},
    "geoFence": {"polygon": CORNERS, "version": 1}, "rallyPoints": {"points": [], "version": 1}}
== a user's.plan | is called Mission | 1 0 0
{"fileType": "Mission", OF: 1, "mission": {"items": [ITEM], "version": 2}}
== scan.plan | no items in it | \
item 2: complex item "StructureScan" does not contain its items: if a newer
{"fileType": "Plan", OF: 1, "mission": {"items": [ITEM, SCAN], "version": 2}}
== numbers as texts.plan | made by a script | item 1: param 5 is "61.4", expected a number
{"fileType": "Plan", OF: 1, "mission": {"version": 2, "items": [
    {"command": 16, "doJumpId": 1, MORE, "coordinate": ["61.4", "23.7", "0"]}]}}
== old.fence | with parameters | 0 1 0
{"fileType": "GeoFence", OF: 1, "parameters": [{"name": "FENCE_ACTION"}], "polygon": CORNERS}
== old.rally | in a file of its own | 0 0 1
{"fileType": "RallyPoints", OF: 1, "points": [[61.4981, 23.761, 5]]}
-- fences
== mavproxy.fen | first where to return to | 0 1 0
61.4984 23.7615
61.4981 23.7610
61.4989 23.7610
61.4989 23.7625
61.4981 23.7610
== planner.fen | blanks, CRLF, a comment | 0 1 0 | CRLF blanks
#saved by APM Planner 1.3
61.4984 23.7615
61.4981 23.7610
61.4989 23.7610
61.4989 23.7625
61.4981 23.7610
== area.poly | nowhere to return to | 0 1 0
61.4981 23.7610
61.4989 23.7610
61.4989 23.7625
61.4981 23.7610
== open.fen | not closed | \
line 4: a fence has a line to return to, at least 3 corners, and ends with the first
61.4984 23.7615
61.4981 23.7610
61.4989 23.7610
61.4989 23.7625
== commas.fen | decimal commas | line 1: 61,4981 is not a number: decimal comma? Write 61.4981
61,4981 23,7610
61,4989 23,7610
61,4989 23,7625
61,4981 23,7610
== fence.waypoints | home, return point, polygon, circle | 0 2 0
QGC WPL 110
HOME
1 0 3 5000 0 0 0 0 61.4981 23.7610 0 1
2 0 3 5001 3 0 0 0 61.4981 23.7610 0 1
3 0 3 5001 3 0 0 0 61.4989 23.7610 0 1
4 0 3 5001 3 0 0 0 61.4989 23.7625 0 1
5 0 3 5004 2.5 0 0 0 61.4989 23.7610 0 1
== fence.txt | numbered from 0, no home | 0 1 0
QGC WPL 110
0 0 3 5002 3 0 0 0 61.4981 23.7610 0 1
1 0 3 5002 3 0 0 0 61.4989 23.7610 0 1
2 0 3 5002 3 0 0 0 61.4989 23.7625 0 1
== corners.waypoints | one was deleted | \
line 3: a fence of 3 corners of which 2 follow; at least 3, and as many as param 1
QGC WPL 110
HOME
1 0 3 5001 3 0 0 0 61.4981 23.7610 0 1
2 0 3 5001 3 0 0 0 61.4989 23.7610 0 1
-- rally points
== mavproxy.ral | RALLY and a blank | 0 0 1
RALLY 61.4981\t23.761\t0\t40\t0\t0
== rally.waypoints | as a mission | 0 0 1
QGC WPL 110
HOME
1 0 3 5100 0 0 0 0 61.4981 23.7610 0 1
-- other files of the same folders
== rover.param | parameters | line 1 is 'WP_SPEED,2', expected JSON
WP_SPEED,2
== track.kml | KML | a fence (latitude and
<?xml version='1.0'?>
<kml/>
== nothing.txt | empty | not a plan file: it is empty | CRLF
"""
FILES = tuple(map(found, re.split(r"\n(?:-- .*\n)?== ", TEXT)[1:]))
