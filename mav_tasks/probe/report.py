"""What was found, as lines for people and as values for scripts."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from enum import Enum
from math import isfinite
from typing import Any, NamedTuple

from mav_tasks.config.settings import SET_FAILSAFE, Identity, Turning
from mav_tasks.engine.services.loss_failsafe import KEEPS_MOVING
from mav_tasks.mavlink.enums import MavResult, MavType
from mav_tasks.probe.findings import Drive, Findings, Rate

NOT_TRIED = "not tried: needs --drive"
UNKNOWN = "unknown"
TYPES: Mapping[int, str] = {MavType.GROUND_ROVER: "ground rover", MavType.SURFACE_BOAT: "boat"}
TURNS_STANDING = 5.0  # deg, more than the noise of a heading
SETPOINT_BIT, COMMAND_INT_BIT = 128, 8  # MAV_PROTOCOL_CAPABILITY


class Mark(Enum):
    """How a line is meant."""

    PLAIN = ""
    GOOD = "ok"
    #: to be looked at before it is driven
    WARNING = "!"
    #: it is not as it must be
    BAD = "!!"


class Line(NamedTuple):
    """One thing that was looked at."""

    topic: str
    words: str
    mark: Mark = Mark.PLAIN


def as_json(findings: Findings) -> dict[str, Any]:
    """Return all of it; what is not a number is null, and what is not known is null or empty."""
    values = asdict(findings)
    values["parameters"] = {
        name: value if isfinite(value) else None for name, value in findings.parameters.items()
    }
    return values


def lines_of(findings: Findings) -> Iterator[Line]:
    """Yield the report, in the order of reading."""
    make = findings.autopilot or "unsupported autopilot"
    kind = TYPES.get(findings.vehicle_type, f"type {findings.vehicle_type}, not a rover")
    mark = Mark.GOOD if findings.autopilot and findings.is_rover else Mark.BAD
    yield Line("rover", f"{findings.system_id}: {make}, {kind}", mark)
    yield Line("firmware", findings.firmware or UNKNOWN, _good(bool(findings.firmware)))
    yield Line("unique id", findings.uid or "not reported")
    yield from _capabilities(findings)
    yield Line("mode", f"{findings.mode or UNKNOWN}, {'ARMED' if findings.armed else 'disarmed'}")
    for other in findings.others:
        yield Line("also connected", other, Mark.WARNING)
    beats = findings.heartbeat_rate
    yield Line("HEARTBEAT", f"{beats:.1f} Hz", _good(beats > 0.5))
    for rate in findings.rates:
        yield _rate(rate)
    restored = findings.rates_given_back
    if restored:
        mark = Mark.WARNING if restored.startswith("no") else Mark.PLAIN
        yield Line("rates restored", restored, mark)
    yield from _arming(findings)
    yield from _mission(findings)
    yield _without_setpoints(findings.loss_by_parameters)
    if findings.turning:
        radius = findings.turning_radius
        circle = "" if radius is None else f", minimum radius {radius:.1f} m"
        words = "on the spot" if findings.turning == Turning.ON_SPOT.value else "like a car"
        yield Line("turns", f"{words}, according to its parameters{circle}")
    if findings.failsafe_set:
        yield Line("loss failsafe", findings.failsafe_set, Mark.GOOD)
    for name, value in findings.parameters.items():
        yield _parameter(name, value, findings)
    if findings.missing_parameters:
        yield Line("not reported", ", ".join(findings.missing_parameters))
    yield from _drive(findings.drive)


def _without_setpoints(said: str) -> Line:
    if said.startswith(KEEPS_MOVING):
        return Line("without setpoints", f"{said}. To make it stop: {SET_FAILSAFE} URL", Mark.BAD)
    mark = Mark.GOOD if said.startswith("stops") else Mark.WARNING
    return Line("without setpoints", said or UNKNOWN, mark)


def _parameter(name: str, value: float, findings: Findings) -> Line:
    operator = findings.parameters.get("SYSID_MYGCS")
    ours = Identity().system_id
    if name == "SYSID_ENFORCE" and value and operator != ours:
        words = f"{value:g}: the rover obeys only system {operator:g}" if operator else f"{value:g}"
        return Line(name, f"{words}; the server is {ours}", Mark.WARNING)
    if name == "FS_GCS_ENABLE" and value:
        words = f"{value:g}: without heartbeats of SYSID_MYGCS the rover does what FS_ACTION says"
        return Line(name, words, Mark.WARNING)
    return Line(name, f"{value:g}")


def _capabilities(findings: Findings) -> Iterator[Line]:
    flags = findings.capabilities
    if flags is None:
        return
    for words, bit in (("COMMAND_INT", COMMAND_INT_BIT), ("local setpoints", SETPOINT_BIT)):
        yield Line(f"takes {words}", "yes" if flags & bit else "not reported")


def _rate(rate: Rate) -> Line:
    if rate.granted is None:
        return Line(rate.name, f"{rate.unasked:.1f} Hz unasked")
    words = f"{rate.granted:.1f} Hz of {rate.wanted:.1f} requested, {rate.unasked:.1f} unasked"
    if rate.answer != MavResult.ACCEPTED.name:
        words += f"; answer: {rate.answer}"
    return Line(rate.name, words, _good(rate.granted >= 0.5 * rate.wanted))


def _arming(findings: Findings) -> Iterator[Line]:
    if findings.prearm:
        words = "; ".join([findings.prearm, *findings.prearm_texts])
        yield Line("arming checks", words, _good(findings.prearm == "ok"))
    elif findings.prearm_texts:
        yield Line("arming checks", "; ".join(findings.prearm_texts), Mark.WARNING)
    else:
        yield Line("arming checks", UNKNOWN)


def _mission(findings: Findings) -> Iterator[Line]:
    count = findings.mission_items
    if count:
        words = f"{count} items: its mission mode would drive them, unseen by the server"
        yield Line("mission on board", words, Mark.WARNING)
    else:
        yield Line("mission on board", UNKNOWN if count is None else "none")


def _drive(drive: Drive | None) -> Iterator[Line]:
    if drive is None:
        yield Line("driving", NOT_TRIED)
        return
    words = drive.ended or "completed"
    yield Line("driving", words, Mark.BAD if drive.ended else Mark.GOOD)
    if drive.left:
        yield Line("left in", drive.left, Mark.BAD if "ARMED" in drive.left else Mark.GOOD)
    if drive.arming:
        yield Line("arming", drive.arming, _good(drive.arming == "accepted"))
    if drive.hold:
        is_held = drive.hold == "yes"
        words, mark = ("accepted", Mark.GOOD) if is_held else ("NOT seen", Mark.BAD)
        yield Line("HOLD", words, mark)
    for name in drive.accepted:
        yield Line("setpoint", f"{name}: followed", Mark.GOOD)
    for name in drive.refused:
        yield Line("setpoint", f"{name}: not followed")
    if drive.yaw_rate:
        share = drive.turned_of_wanted
        turned = "" if share is None else f" ({share:.0%} of the turn, on the spot)"
        yield Line("yaw rate", drive.yaw_rate + turned)
    turned_standing = drive.turned_standing_deg
    if turned_standing is not None:
        is_turning = abs(turned_standing) > TURNS_STANDING
        words = f"turned by {turned_standing:.0f} deg in 2 s of zero setpoints"
        yield Line("standing", words, Mark.WARNING if is_turning else Mark.PLAIN)
    if drive.reverse:
        yield Line("reverse", drive.reverse)
    if drive.speed is not None:
        words = f"{drive.stopping_distance:.2f} m and {drive.stopping_time:.1f} s"
        yield Line("stop on zeros", f"{words} from {drive.speed:.2f} m/s")
    yield from _loss(drive)
    yield Line("farthest", f"{drive.farthest:.2f} m from the start")


def _loss(drive: Drive) -> Iterator[Line]:
    if drive.loss_stop == "yes" and drive.loss_distance is not None:
        after = drive.setpoint_timeout
        words = (
            f"stops by itself, {drive.loss_distance:.2f} m further, from {drive.loss_speed:.2f} m/s"
        )
        words += "" if after is None else f", after {after:.1f} s"
        yield Line("setpoints stop", words, Mark.GOOD)
    elif drive.loss_stop == "no":
        words = drive.loss_note or "it keeps driving"
        yield Line("setpoints stop", f"does NOT stop by itself; {words}", Mark.BAD)
    elif drive.loss_note:
        yield Line("setpoints stop", drive.loss_note, Mark.WARNING)


def _good(is_good: bool) -> Mark:
    return Mark.GOOD if is_good else Mark.WARNING
