"""The mission protocol of a rover: what is uploaded comes back, and can be cleared."""

import math
from collections.abc import Sequence
from typing import Any

from pymavlink.dialects.v20 import development as mav

from rover_sim.observing.observer import AUTOPILOT, Observer

STEP_LIMIT = 1.5  # s, QGroundControl's
TRIES = 3
RADIUS = 1000.0  # m, of a fence too large to affect a rover
#: small plans: command, param1, how many, by MAV_MISSION_TYPE
PLANS = {
    mav.MAV_MISSION_TYPE_MISSION: (mav.MAV_CMD_NAV_WAYPOINT, 0.0, 3),
    mav.MAV_MISSION_TYPE_FENCE: (mav.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, RADIUS, 1),
    mav.MAV_MISSION_TYPE_RALLY: (mav.MAV_CMD_NAV_RALLY_POINT, 0.0, 1),
}

#: of MISSION_ITEM_INT, between seq and mission_type
FIELDS: tuple[str, ...] = ("frame", "command", "current", "autocontinue")
FIELDS += ("param1", "param2", "param3", "param4", "x", "y", "z")
Item = tuple[Any, ...]


class Wrong(Exception):
    """The rover does not do as the protocol says; the message says where."""


async def check(
    observer: Observer, kind: int, around: tuple[int, int], first: int, may_write: bool
) -> str:
    """Download a plan; with leave, upload another one, compare, clear and restore. Raise Wrong.

    ``first``: items before it are the rover's own.
    """
    before = await download(observer, kind)
    if not may_write:
        return f"{len(before)} items; nothing written"
    try:
        plan = _plan(kind, *around)
        await upload(observer, kind, plan)
        back = await download(observer, kind)
        gists = [[(item[1], *item[8:10]) for item in items[first:]] for items in (plan, back)]
        if gists[0] != gists[1]:
            raise Wrong(f"uploaded {gists[0]}, back came {gists[1]}")
        observer.send(observer.out.mission_clear_all_encode(observer.system, AUTOPILOT, kind))
        ack = await observer.wait("MISSION_ACK", STEP_LIMIT)
        left = await download(observer, kind)
        if ack is None or ack.type or len(left) > first:
            raise Wrong(f"cleared with {ack}, and {len(left)} items are left")
    finally:
        await upload(observer, kind, before)
    return f"{len(plan)} items came back; {len(before)} restored"


async def download(observer: Observer, kind: int) -> list[Item]:
    """Return the items of a plan. Raise Wrong."""
    out, target = observer.out, (observer.system, AUTOPILOT)
    asking = out.mission_request_list_encode(*target, kind)
    count = (await _ask(observer, asking, "MISSION_COUNT", lambda m: m.mission_type == kind)).count
    items = []
    for seq in range(count):
        asking = out.mission_request_int_encode(*target, seq, kind)
        item = await _ask(observer, asking, "MISSION_ITEM_INT", lambda m, seq=seq: m.seq == seq)
        items.append(tuple(getattr(item, name) for name in FIELDS))
    observer.send(out.mission_ack_encode(*target, 0, kind))
    return items


async def upload(observer: Observer, kind: int, plan: Sequence[Item]) -> None:
    """Upload a plan. Raise Wrong."""
    out, target = observer.out, (observer.system, AUTOPILOT)
    asking = out.mission_count_encode(*target, len(plan), kind)
    while True:
        wanted = await _ask(
            observer,
            asking,
            "MISSION_REQUEST MISSION_REQUEST_INT MISSION_ACK",
            lambda m: m.mission_type == kind,
        )
        if wanted.get_type() == "MISSION_ACK":
            ours = (out.srcSystem, out.srcComponent)
            if wanted.type or (wanted.target_system, wanted.target_component) != ours:
                raise Wrong(f"upload: {wanted}")
            return
        if wanted.seq >= len(plan):
            raise Wrong(f"it asked for item {wanted.seq} of {len(plan)}")
        asking = out.mission_item_int_encode(*target, wanted.seq, *plan[wanted.seq], kind)


async def _ask(observer: Observer, message: Any, answer: str, fits: Any) -> Any:
    for _ in range(TRIES):
        observer.send(message)
        found = await observer.wait(answer, STEP_LIMIT, fits)
        if found is not None:
            return found
    raise Wrong(f"no {answer} after {message.get_type()}")


def _plan(kind: int, latitude: int, longitude: int) -> list[Item]:
    """Return a small plan around a place."""
    command, radius, count = PLANS[kind]
    is_mission = kind == mav.MAV_MISSION_TYPE_MISSION
    frame = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT if is_mission else mav.MAV_FRAME_GLOBAL
    yaw = math.nan if is_mission else 0.0  # like QGroundControl: no heading
    same = (1, radius, 0.0, 0.0, yaw)
    return [
        (frame, command, int(is_mission and not n), *same, latitude + 300 * n, longitude, 0.0)
        for n in range(count)
    ]
