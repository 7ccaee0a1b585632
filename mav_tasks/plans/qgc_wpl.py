"""Text files: "QGC WPL", fences (latitude and longitude a line) and rally points (RALLY lines).

MAVLink guide, "File Formats", "Mission Plain-Text File Format". In version 110, as Mission Planner,
MAVProxy, APM Planner and QGroundControl write it, the line numbered 0 is home, whatever stands in
it; a file numbered from 1, and version 120 of older QGroundControl, have no home. Other numbers of
lines do not matter without a DO_JUMP; with one, programs differ in what it means. Lines of fence
and rally commands are the fence and the rally points. What follows a # is left out.
"""

import re
from collections.abc import Sequence

from mav_tasks.basics.errors import PlanFileError
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.plans.entries import GLOBAL_FRAMES, Entry, item, point, with_targets
from mav_tasks.plans.fetched import CIRCLES, VERTICES
from mav_tasks.plans.fields import counted, shown, whole
from mav_tasks.plans.values import FenceCircle, FencePolygon, GeoPoint, PlanFile

LINE_END = re.compile(r"\r\n|\r|\n")  # as an editor counts lines
FENCE = (MavCmd.NAV_FENCE_RETURN_POINT, *VERTICES, *CIRCLES)
FIELDS = "number, current, frame, command, seven parameters, autocontinue"
OLD = {
    "100": "of 2010: load it with MAVProxy (wp load) and save it again (wp save)",
    "PB 110": "of MAVProxy's own: load it there (wp load) and save it again (wp save)",
}

Line = tuple[str, list[str]]  # its name, and its words


def from_text(text: str) -> PlanFile:
    """Return what a text says; PlanFileError names the line, as an editor counts it."""
    numbered = enumerate(LINE_END.split(text), 1)
    split = ((f"line {number}", line.split("#")[0].split()) for number, line in numbered)
    lines = [(name, words) for name, words in split if words]
    if not lines:
        raise PlanFileError("not a plan file: it is empty")
    name, words = lines[0]
    if words[:2] == ["QGC", "WPL"]:
        return _from_wpl(" ".join(words[2:]), lines[1:])
    if words[0] == "RALLY":
        return PlanFile((), None, (), tuple(_rally_point(*line) for line in lines))
    if len(words) == 2 and all(_is_like_a_number(word) for word in words):
        return PlanFile((), None, (_ring(lines),), ())
    if len(words) == 12 and all(_is_like_a_number(word) for word in words):
        raise PlanFileError(f"{name}: a mission, but its first line is missing: add 'QGC WPL 110'")
    raise PlanFileError(
        f"not a plan file: {name} is {repr(' '.join(words))[:40]}, expected JSON (.plan, .mission),"
        " 'QGC WPL 110', a fence (latitude and longitude a line) or RALLY lines"
    )


def _from_wpl(version: str, lines: Sequence[Line]) -> PlanFile:
    if version in OLD:
        raise PlanFileError(f"'QGC WPL {version}' is a format {OLD[version]}")
    if version not in ("110", "120"):
        raise PlanFileError(f"{f'QGC WPL {version}'[:40]!r} is not supported, expected 110 or 120")
    entries = [_entry(*line) for line in lines]
    home, first = None, 0
    if version == "110" and entries and entries[0].known_as == 0 and not _is_fence(entries[0]):
        home, first = entries[0].item, 1
    mission = [entry for entry in entries[first:] if not _is_fence(entry)]
    _check_numbers(mission)
    return PlanFile(
        with_targets(mission),
        None
        if home is None or home.command == 0 or home.frame not in GLOBAL_FRAMES
        else GeoPoint(home.x, home.y, home.z),
        _fence([entry for entry in entries if entry.item.command in FENCE]),
        tuple(
            GeoPoint(entry.item.x, entry.item.y, entry.item.z)
            for entry in entries
            if entry.item.command == MavCmd.NAV_RALLY_POINT
        ),
    )


def _is_fence(entry: Entry) -> bool:
    return entry.item.command in (*FENCE, MavCmd.NAV_RALLY_POINT)


def _check_numbers(entries: Sequence[Entry]) -> None:
    """Refuse a jump among lines that do not count up: it may mean a number or a place."""
    jump = next((entry for entry in entries if entry.item.command == MavCmd.DO_JUMP), None)
    if jump is None:
        return
    first = entries[0].known_as or 0
    for number, entry in enumerate(entries, first):
        if entry.known_as != number:
            raise PlanFileError(
                f"{entry.where}: numbered {entry.known_as}, expected {number}: number the lines"
                f" one after the other, for {jump.where} jumps to one of them"
            )


def _entry(where: str, words: list[str]) -> Entry:
    if len(words) == 1 and words[0].count(",") >= 11:
        raise PlanFileError(f"{where}: separated by commas: separate the fields by tabs")
    if len(words) != 12:
        raise PlanFileError(f"{where}: {counted(len(words), 'field')}, expected 12 ({FIELDS})")
    values = [_number(where, word) for word in words]
    autocontinue = whole(where, "autocontinue", values[11], 1) == 1
    frame, command = values[2:4]
    return Entry(
        where,
        whole(where, "the number of the line", values[0], 65535),
        item(where, frame, command, params=values[4:11], autocontinue=autocontinue),
    )


def _fence(entries: list[Entry]) -> tuple[FencePolygon | FenceCircle, ...]:
    """Return the zones; the point to return to is left out."""
    parts: list[FencePolygon | FenceCircle] = []
    rest = [entry for entry in entries if entry.item.command != MavCmd.NAV_FENCE_RETURN_POINT]
    while rest:
        where, _, first = rest[0]
        command, size = MavCmd(first.command), first.params[0]
        if command in CIRCLES:
            if not size > 0:
                raise PlanFileError(f"{where}: radius {shown(size)} m is not above 0")
            parts.append(FenceCircle(CIRCLES[command], (first.x, first.y), size))
            rest = rest[1:]
            continue
        count = whole(where, "the number of corners (param 1)", size, 65535)
        corners = [entry.item for entry in rest[:count]]
        if count < 3 or len(corners) < count or {each.command for each in corners} != {command}:
            same = sum(each.command == command for each in corners)
            raise PlanFileError(
                f"{where}: a fence of {count} corners of which {same} follow; at least 3, and as"
                " many as param 1 says, are needed"
            )
        parts.append(FencePolygon(VERTICES[command], tuple((each.x, each.y) for each in corners)))
        rest = rest[count:]
    return tuple(parts)


def _ring(lines: Sequence[Line]) -> FencePolygon:
    """Return the fence of a .fen file, whose first line is the point to return to, or a .poly."""
    for name, words in lines:
        if len(words) != 2:
            raise PlanFileError(f"{name}: {counted(len(words), 'field')}, expected 2")
    places = [_place(name, words) for name, words in lines]
    first = next((number for number in (0, 1) if places[-1] in places[number : number + 1]), None)
    if first is None or len(places) - first < 4:
        raise PlanFileError(
            f"{lines[-1][0]}: a fence has a line to return to, at least 3 corners, and ends with"
            " the first corner again"
        )
    return FencePolygon(True, tuple(place[:2] for place in places[first:-1]))


def _rally_point(name: str, words: list[str]) -> GeoPoint:
    """Fields: RALLY, latitude, longitude, altitude, and three about landing, which no rover has."""
    if words[0] != "RALLY" or len(words) < 4:
        raise PlanFileError(f"{name}: expected RALLY, latitude, longitude and altitude")
    return _place(name, words[1:4])


def _place(name: str, words: list[str]) -> GeoPoint:
    return point(name, [_number(name, word) for word in words], len(words))


def _is_like_a_number(word: str) -> bool:
    return word.strip("+-0123456789.,eE") == ""


def _number(where: str, word: str) -> float:
    try:
        return float(word.replace("_", "?"))  # float() would read 1_0 as 10
    except ValueError:
        if word.count(",") == 1 and _is_like_a_number(word):
            words = f"decimal comma? Write {word.replace('.', '').replace(',', '.')[:40]}"
        else:
            words = "write it with the digits 0 to 9 and a point"
        raise PlanFileError(f"{where}: {word[:40]} is not a number: {words}") from None
