"""The autopilot's own mission, fence and rally storage: the vehicle's end of the mission protocol.

MAVLink guide, "Mission Protocol", as Rover 4.6.3 speaks it: it asks with MISSION_REQUEST, never
with the INT form, takes MISSION_ITEM_INT in answer, and knows no opaque ids.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavFrame, MavMissionResult, MavSeverity
from rover_sim.dispatch import Handler
from rover_sim.geo import LATITUDE_LIMIT_DEGE7, LONGITUDE_LIMIT_DEGE7, Origin
from rover_sim.outbox import Outbox
from rover_sim.route import Route, Waypoint
from rover_sim.setpoints import Destination

CAPACITY = 655  # items
REQUEST_INTERVAL = 1.0  # s between repeats of an unanswered MISSION_REQUEST
UPLOAD_TIMEOUT = 8.0  # s without an item
MISSION, FENCE, RALLY, ALL = 0, 1, 2, 255  # MAV_MISSION_TYPE
NAV_WAYPOINT = 16
# MAV_CMDs that Rover stores; per type.
STORABLE: Mapping[int, frozenset[int]] = {
    MISSION: frozenset({16, 17, 18, 19, 20, 42, 82, 83, 92, 93, 94, 112, 113, 114, 115})
    | frozenset(range(177, 220)),
    FENCE: frozenset(range(5000, 5005)),
    RALLY: frozenset({5100}),
}
STORED_FRAMES: Mapping[int, int] = {  # INT frames come back as their plain forms
    MavFrame.GLOBAL_INT: MavFrame.GLOBAL,
    MavFrame.GLOBAL_RELATIVE_ALT_INT: MavFrame.GLOBAL_RELATIVE_ALT,
}

Item = messages.MissionItemInt | messages.MissionItem
Request = messages.MissionRequestInt | messages.MissionRequest


@dataclass(slots=True)
class _Upload:
    partner: Address
    mission_type: int
    count: int
    last_item_at: float
    asked_at: float
    items: list[messages.MissionItemInt] = field(default_factory=list)


class MissionStorage:
    """Three lists of items and at most one upload. They survive a reboot."""

    def __init__(self, *, origin: Origin, outbox: Outbox) -> None:
        self._origin = origin
        self._outbox = outbox
        self._lists: dict[int, list[messages.MissionItemInt]] = {MISSION: [], FENCE: [], RALLY: []}
        self._upload: _Upload | None = None
        self.handlers: Mapping[int, Handler] = {
            messages.MissionCount.id: self._handle_count,
            messages.MissionItemInt.id: self._handle_item,
            messages.MissionItem.id: self._handle_item,
            messages.MissionRequestList.id: self._handle_request_list,
            messages.MissionRequestInt.id: self._handle_request,
            messages.MissionRequest.id: self._handle_request,
            messages.MissionClearAll.id: self._handle_clear_all,
            messages.MissionAck.id: self._handle_ack,
        }

    def __repr__(self) -> str:
        return f"MissionStorage({[len(items) for items in self._lists.values()]})"

    @property
    def item_count(self) -> int:
        """How many items of a mission there are, item 0 (home) not counted."""
        return max(0, len(self._lists[MISSION]) - 1)

    def route(self) -> Route | None:
        """Give the stored mission's waypoints, or None if there are none."""
        waypoints = tuple(
            Waypoint(seq, Destination(*self._origin.to_local(item.x, item.y)))
            for seq, item in enumerate(self._lists[MISSION])
            if seq > 0 and item.command == NAV_WAYPOINT
        )
        return Route(waypoints, loop=False) if waypoints else None

    def step(self, *, now: float) -> None:
        """Repeat an unanswered request, and give up in the end."""
        upload = self._upload
        if upload is None:
            return
        if now - upload.last_item_at >= UPLOAD_TIMEOUT:
            self._outbox.say(MavSeverity.WARNING, "Mission upload timeout")
            self._finish(upload, MavMissionResult.OPERATION_CANCELLED)
        elif now - upload.asked_at >= REQUEST_INTERVAL:
            self._ask(upload, now)

    def _handle_count(self, message: messages.MissionCount, sender: Address, now: float) -> None:
        mission_type = message.mission_type
        if mission_type not in self._lists:
            self._ack(sender, mission_type, MavMissionResult.UNSUPPORTED)
        elif self._upload is not None and self._upload.partner != sender:
            self._ack(sender, mission_type, MavMissionResult.DENIED)
        elif message.count > CAPACITY:
            text = f"Only {CAPACITY} items are supported"
            self._outbox.say(MavSeverity.WARNING, text)
            self._ack(sender, mission_type, MavMissionResult.NO_SPACE)
        else:
            upload = _Upload(sender, mission_type, message.count, last_item_at=now, asked_at=now)
            if message.count == 0:
                self._store(upload)
            else:
                self._upload = upload
                self._ask(upload, now)

    def _handle_item(self, message: Item, sender: Address, now: float) -> None:
        upload = self._upload
        if upload is None or upload.partner != sender:
            self._ack(sender, message.mission_type, MavMissionResult.ERROR)
        elif message.seq != len(upload.items):
            self._ack(sender, upload.mission_type, MavMissionResult.INVALID_SEQUENCE)
        elif refusal := _refusal(message, upload.mission_type):
            self._finish(upload, refusal)
        else:
            upload.items.append(_as_stored(message))
            upload.last_item_at = now
            if len(upload.items) == upload.count:
                self._store(upload)
            else:
                self._ask(upload, now)

    def _handle_request_list(
        self, message: messages.MissionRequestList, sender: Address, _now: float
    ) -> None:
        stored = self._lists.get(message.mission_type)
        if stored is None:
            self._ack(sender, message.mission_type, MavMissionResult.UNSUPPORTED)
        else:
            self._outbox.send(
                messages.MissionCount(*sender, len(stored), message.mission_type),
            )

    def _handle_request(self, message: Request, sender: Address, _now: float) -> None:
        stored = self._lists.get(message.mission_type, [])
        if message.seq >= len(stored):
            self._ack(sender, message.mission_type, MavMissionResult.ERROR)
            return
        item = stored[message.seq]
        self._outbox.send(_item_for(sender, item, item.x, item.y))

    def _handle_clear_all(
        self, message: messages.MissionClearAll, sender: Address, _now: float
    ) -> None:
        for mission_type, stored in self._lists.items():
            if message.mission_type in (mission_type, ALL):
                stored.clear()
        self._ack(sender, message.mission_type, MavMissionResult.ACCEPTED)

    def _handle_ack(self, message: messages.MissionAck, sender: Address, _now: float) -> None:
        """A client's ack ends a download, which needs nothing here, or cancels its upload."""
        upload = self._upload
        if upload is None or upload.partner != sender:
            return
        if message.type == MavMissionResult.OPERATION_CANCELLED:
            self._upload = None

    def _store(self, upload: _Upload) -> None:
        self._lists[upload.mission_type] = upload.items
        if upload.mission_type == MISSION and upload.items:
            self._put_home_first(upload.items)
        self._finish(upload, MavMissionResult.ACCEPTED)

    def _put_home_first(self, items: list[messages.MissionItemInt]) -> None:
        """Item 0 is home: what was uploaded there is replaced."""
        origin = self._origin
        home = items[0]
        home.frame, home.command = MavFrame.GLOBAL, NAV_WAYPOINT
        home.x, home.y = origin.latitude_degE7, origin.longitude_degE7
        home.z = origin.altitude

    def _finish(self, upload: _Upload, result: MavMissionResult) -> None:
        self._upload = None
        self._ack(upload.partner, upload.mission_type, result)

    def _ask(self, upload: _Upload, now: float) -> None:
        upload.asked_at = now
        self._outbox.send(
            messages.MissionRequest(*upload.partner, len(upload.items), upload.mission_type)
        )

    def _ack(self, partner: Address, mission_type: int, result: MavMissionResult) -> None:
        self._outbox.send(messages.MissionAck(*partner, result, mission_type))


def _refusal(item: Item, mission_type: int) -> MavMissionResult | None:
    if item.command not in STORABLE[mission_type]:
        return MavMissionResult.UNSUPPORTED
    latitude, longitude = _place_of(item)
    if not abs(latitude) <= LATITUDE_LIMIT_DEGE7:  # NaN, from the float form, is not
        return MavMissionResult.INVALID_PARAM5_X
    if not abs(longitude) <= LONGITUDE_LIMIT_DEGE7:
        return MavMissionResult.INVALID_PARAM6_Y
    return None


def _place_of(item: Item) -> tuple[float, float]:
    """Give latitude and longitude in degE7, from either form."""
    if isinstance(item, messages.MissionItem):
        return item.x * 1e7, item.y * 1e7
    return item.x, item.y


def _as_stored(item: Item) -> messages.MissionItemInt:
    """Keep every item in the INT form, in the frames that ArduPilot gives back."""
    latitude, longitude = _place_of(item)
    return _item_for(Address(0, 0), item, round(latitude), round(longitude))


def _item_for(partner: Address, item: Item, x: int, y: int) -> messages.MissionItemInt:
    return messages.MissionItemInt(
        *partner,
        item.seq,
        STORED_FRAMES.get(item.frame, item.frame),
        item.command,
        0,
        item.autocontinue,
        item.param1,
        item.param2,
        item.param3,
        item.param4,
        x,
        y,
        item.z,
        item.mission_type,
    )
