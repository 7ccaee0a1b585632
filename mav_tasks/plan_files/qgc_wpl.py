"""The text format "QGC WPL 110"; MAVLink guide, "File Formats", "Mission Plain-Text File Format".

Line 0 is home if it is a NAV_WAYPOINT in the frame GLOBAL, as Mission Planner, MAVProxy and
QGroundControl have it, else it is an item. Lines that begin with # are left out. Refused: numbers
of lines that do not count up from 0, since programs differ in what a DO_JUMP means there.
"""

from mav_tasks.errors import PlanFileError
from mav_tasks.mavlink.enums import MavCmd, MavFrame
from mav_tasks.plan_files.entries import Entry, item, with_targets
from mav_tasks.plan_files.fields import shown, whole
from mav_tasks.plan_files.values import GeoPoint, PlanFile


def from_wpl(text: str) -> PlanFile:
    """Return what a text says; PlanFileError names the line, from 1."""
    numbered = ((number, line.split()) for number, line in enumerate(text.splitlines(), 1))
    lines = [(number, words) for number, words in numbered if words and words[0][0] != "#"]
    _check_header(lines[0][1] if lines else [])
    entries = [
        _entry(f"line {number}", words, seq) for seq, (number, words) in enumerate(lines[1:])
    ]
    if not entries or not _is_home(entries[0]):
        return PlanFile(with_targets(entries), None, (), ())
    first = entries[0].item
    return PlanFile(with_targets(entries[1:]), GeoPoint(first.x, first.y, first.z), (), ())


def _check_header(words: list[str]) -> None:
    if not words:
        raise PlanFileError("not a plan file: it is empty")
    if words[:2] != ["QGC", "WPL"]:
        raise PlanFileError("not a plan file: neither JSON nor QGC WPL 110")
    if words[2:] != ["110"]:
        raise PlanFileError(f"{' '.join(words)[:40]!r} is not supported, expected 'QGC WPL 110'")


def _is_home(entry: Entry) -> bool:
    return entry.item.command == MavCmd.NAV_WAYPOINT and entry.item.frame == MavFrame.GLOBAL


def _entry(where: str, words: list[str], seq: int) -> Entry:
    """Fields: seq, current, frame, command, seven parameters, autocontinue."""
    if len(words) != 12:
        raise PlanFileError(f"{where}: {len(words)} fields, expected 12")
    values = [_number(where, index, word) for index, word in enumerate(words, 1)]
    if values[0] != seq:
        raise PlanFileError(f"{where}: numbered {shown(values[0])}, expected {seq}")
    autocontinue = whole(where, "autocontinue", values[11], 1) == 1
    frame, command = values[2:4]
    return Entry(
        where, seq, item(where, frame, command, params=values[4:11], autocontinue=autocontinue)
    )


def _number(where: str, index: int, word: str) -> float:
    try:
        return float(word.replace("_", "?"))  # float() would read 1_0 as 10
    except ValueError:
        raise PlanFileError(f"{where}: field {index} is {word[:40]!r}, expected a number") from None
