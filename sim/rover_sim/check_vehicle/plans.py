"""Missions, fences and rally points: download, and with ``write`` upload and restore."""

import math
from collections.abc import Sequence
from typing import Any

from rover_sim.check_vehicle.context import Context
from rover_sim.check_vehicle.identity import AUTOPILOT_VERSION
from rover_sim.check_vehicle.probe import AUTOPILOT, OURS
from rover_sim.check_vehicle.telemetry import GLOBAL_POSITION_INT

MISSION_REQUEST, MISSION_COUNT, MISSION_ACK, MISSION_REQUEST_INT, MISSION_ITEM_INT = (
    40,
    44,
    47,
    51,
    73,
)
ACCEPTED = 0  # MAV_MISSION_RESULT
STEP_LIMIT = 1.5  # s, QGroundControl's
TRIES = 3
TYPES = {0: "mission", 1: "fence", 2: "rally points"}
CAPABILITY = {1: 16384, 2: 32768}  # MAV_PROTOCOL_CAPABILITY: fence, rally
WAYPOINT, FENCE_CIRCLE, RALLY_POINT = 16, 5003, 5100
GLOBAL_RELATIVE_ALT = 3
FENCE_RADIUS = 1000.0  # m: too large to affect a rover


def check_plans(context: Context) -> None:
    """Download each plan; with ``write`` upload another, compare, clear, and restore."""
    for mission_type, name in TYPES.items():
        capability = CAPABILITY.get(mission_type, 0)
        version = context.probe.last(AUTOPILOT_VERSION)
        if version is not None and version.capabilities & capability != capability:
            context.report.skip(name, "not among its capabilities")
            continue
        items = _check_download(context, mission_type, name)
        if items is None:
            continue
        if not context.options.write:
            context.report.skip(f"{name}: upload", "changes what is stored; --write checks it")
            continue
        try:
            _check_upload(context, mission_type, name)
        finally:
            result = _upload(context, mission_type, items)
            if result != "accepted":
                why = f"the old items are not restored: {result}"
                context.report.fail(f"{name}: restore", expected="accepted", seen=why)


def _check_download(context: Context, mission_type: int, name: str) -> list[Any] | None:
    items = _download(context, mission_type)
    context.report.expect(
        f"{name}: download",
        not isinstance(items, str),
        expected="MISSION_COUNT, addressed to the sender, and each requested item",
        seen=items if isinstance(items, str) else f"{len(items)} items",
    )
    return None if isinstance(items, str) else items


def _check_upload(context: Context, mission_type: int, name: str) -> None:
    report = context.report
    plan = _plan(context, mission_type)
    result = _upload(context, mission_type, plan)
    report.expect(
        f"{name}: upload",
        result == "accepted",
        expected="a request for each item in turn, then MISSION_ACK ACCEPTED to the sender",
        seen=result,
    )
    back = _download(context, mission_type)
    first = 1 if mission_type == 0 and context.way.home_is_item_0 else 0  # home may replace it
    same = not isinstance(back, str) and [_gist(each) for each in back[first:]] == [
        _gist(each) for each in plan[first:]
    ]
    report.expect(
        f"{name}: comes back",
        same,
        expected=f"the {len(plan)} items that were uploaded, same commands and places",
        seen=back if isinstance(back, str) else f"{[_gist(each) for each in back]}",
    )
    probe, mark = context.probe, context.probe.mark()
    probe.send(probe.messages.mission_clear_all_encode(probe.system_id, AUTOPILOT, mission_type))
    ack = probe.wait(MISSION_ACK, STEP_LIMIT, since=mark)
    left = _download(context, mission_type)
    report.expect(
        f"{name}: clear",
        ack is not None and ack.type == ACCEPTED and isinstance(left, list) and len(left) <= first,
        expected="MISSION_ACK ACCEPTED, then nothing (at most home) to download",
        seen=("no MISSION_ACK" if ack is None else f"result {ack.type}")
        + f", {left if isinstance(left, str) else f'{len(left)} items'}",
    )


def _download(context: Context, mission_type: int) -> list[Any] | str:
    """Return the items, or a description of the failure."""
    probe, target = context.probe, (context.probe.system_id, AUTOPILOT)

    def of_type(message: Any) -> bool:
        return bool(message.mission_type == mission_type)

    asking = probe.messages.mission_request_list_encode(*target, mission_type)
    count = _ask(context, asking, MISSION_COUNT, of_type)
    if count is None:
        return "no MISSION_COUNT"
    if (count.target_system, count.target_component) != OURS:
        return f"MISSION_COUNT for {count.target_system}/{count.target_component}"
    items = []
    for seq in range(count.count):
        asking = probe.messages.mission_request_int_encode(*target, seq, mission_type)
        item = _ask(
            context, asking, MISSION_ITEM_INT, lambda m, seq=seq: of_type(m) and m.seq == seq
        )
        if item is None:
            return f"no MISSION_ITEM_INT {seq} of {count.count}"
        items.append(item)
    probe.send(probe.messages.mission_ack_encode(*target, ACCEPTED, mission_type))
    return items


def _upload(context: Context, mission_type: int, plan: Sequence[Any]) -> str:
    """Upload a plan; return "accepted", or a description of the failure."""
    probe, target = context.probe, (context.probe.system_id, AUTOPILOT)
    mark = probe.mark()
    probe.send(probe.messages.mission_count_encode(*target, len(plan), mission_type))
    asked = 0
    end = probe.now + STEP_LIMIT
    while probe.now < end:
        probe.pump()
        news, mark = probe.log[mark:], probe.mark()
        for heard in news:
            message = heard.message
            if heard.component != AUTOPILOT or getattr(message, "mission_type", -1) != mission_type:
                continue
            if heard.id in (MISSION_REQUEST, MISSION_REQUEST_INT):
                if message.seq >= len(plan):
                    return f"it asked for item {message.seq} of {len(plan)}"
                probe.send(_addressed(context, plan[message.seq], message.seq))
                asked, end = asked + 1, probe.now + STEP_LIMIT
            elif heard.id == MISSION_ACK:
                if (message.target_system, message.target_component) != OURS:
                    return f"MISSION_ACK for {message.target_system}/{message.target_component}"
                return "accepted" if message.type == ACCEPTED else f"result {message.type}"
    return f"no MISSION_ACK; it asked {asked} times for an item of {len(plan)}"


def _ask(context: Context, message: Any, answer: int, condition: Any) -> Any:
    for _ in range(TRIES):
        mark = context.probe.mark()
        context.probe.send(message)
        found = context.probe.wait(answer, STEP_LIMIT, since=mark, condition=condition)
        if found is not None:
            return found
    return None


def _plan(context: Context, mission_type: int) -> list[Any]:
    """Return a small plan around the rover's position."""
    place = context.probe.last(GLOBAL_POSITION_INT)
    latitude, longitude = (place.lat, place.lon) if place is not None else (0, 0)
    if mission_type == 0:
        return [
            _item(context, seq, WAYPOINT, 0.0, latitude + 300 * seq, longitude, 0)
            for seq in range(3)
        ]
    if mission_type == 1:
        return [_item(context, 0, FENCE_CIRCLE, FENCE_RADIUS, latitude, longitude, 1)]
    return [_item(context, 0, RALLY_POINT, 0.0, latitude, longitude, 2)]


def _item(
    context: Context, seq: int, command: int, param1: float, x: int, y: int, mission_type: int
) -> Any:
    frame = GLOBAL_RELATIVE_ALT if mission_type == 0 else 0
    yaw = math.nan if command == WAYPOINT else 0.0  # like QGroundControl: no heading
    return context.probe.messages.mission_item_int_encode(
        0, 0, seq, frame, command, int(seq == 0), 1, param1, 0.0, 0.0, yaw, x, y, 0.0, mission_type
    )


def _addressed(context: Context, item: Any, seq: int) -> Any:
    return context.probe.messages.mission_item_int_encode(
        context.probe.system_id,
        AUTOPILOT,
        seq,
        item.frame,
        item.command,
        int(seq == 0 and item.mission_type == 0),
        item.autocontinue,
        item.param1,
        item.param2,
        item.param3,
        item.param4,
        item.x,
        item.y,
        item.z,
        item.mission_type,
    )


def _gist(item: Any) -> tuple[int, int, int]:
    return item.command, item.x, item.y
