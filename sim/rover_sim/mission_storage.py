"""The autopilot's own mission, fence and rally storage: the vehicle side of the mission protocol.

MAVLink guide, "Mission Protocol"; the persona's ``MissionConventions`` has what it leaves open.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from struct import pack
from typing import Any
from zlib import crc32

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavFrame, MavMissionResult, MavSeverity
from rover_sim.geo import is_on_earth
from rover_sim.mission_conventions import ALL, FENCE, MISSION, RALLY
from rover_sim.onboard import Onboard
from rover_sim.route import Route, Waypoint
from rover_sim.setpoints import Destination

NAV_WAYPOINT = 16
GUIDED_ITEM = 2  # MISSION_ITEM.current

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

    def __init__(self, on: Onboard, go_to: Callable[[Destination], bool]) -> None:
        """``go_to`` drives to the place of a guided item; it returns False if refused."""
        self._on = on
        self._conventions = on.persona.missions
        self._origin = on.origin
        self._outbox = on.outbox
        self._drive_to = go_to
        self._lists: dict[int, list[messages.MissionItemInt]] = {MISSION: [], FENCE: [], RALLY: []}
        self._upload: _Upload | None = None
        self._stored: _Upload | None = None  # the last complete upload
        self.current = 0  # where AUTO resumes, on makes that resume
        self.complete = False  # AUTO reached the end of the mission
        self.handlers: Mapping[int, Callable[[Any, Address], None]] = {
            messages.MissionCount.id: self._handle_count,
            messages.MissionItemInt.id: self._handle_item,
            messages.MissionItem.id: self._handle_item,
            messages.MissionRequestList.id: self._handle_request_list,
            messages.MissionRequestInt.id: self._handle_request,
            messages.MissionRequest.id: self._handle_request,
            messages.MissionClearAll.id: self._handle_clear_all,
            messages.MissionAck.id: self._handle_ack,
        }

    def stored(self, mission_type: int) -> tuple[messages.MissionItemInt, ...]:
        """Return the items of a plan, as a download would return them."""
        return tuple(self._lists[mission_type])

    @property
    def item_count(self) -> int:
        """Number of mission items, without home."""
        return max(0, len(self._lists[MISSION]) - self._first_item)

    def route(self) -> Route | None:
        """Return the stored mission's waypoints, or None if there are none."""
        waypoints = tuple(
            Waypoint(seq, Destination(*self._origin.to_local(item.x, item.y)))
            for seq, item in enumerate(self._lists[MISSION])
            if seq >= self._first_item and item.command == NAV_WAYPOINT
        )
        return Route(waypoints) if waypoints else None

    def move_to(self, seq: int) -> bool:
        """Set the item at which AUTO continues; return False if it does not exist.

        A make that restarts each mission accepts any number.
        """
        if not self._conventions.goes_on:
            return True
        if seq >= len(self._lists[MISSION]):
            return False
        self.current = seq
        return True

    def plan_id(self, mission_type: int) -> int:
        """Return a list's opaque id: 0 if it is empty or the make has no ids, else not 0."""
        items = self._lists[mission_type]
        if not items or not self._conventions.has_ids:
            return 0
        return crc32(b"".join(_content(item) for item in items)) or 1

    def step(self) -> None:
        """Repeat an unanswered request; end the upload after its time-out."""
        upload = self._upload
        if upload is None:
            return
        conventions = self._conventions
        if self._on.now - upload.last_item_at >= conventions.upload_timeout:
            self._outbox.say(MavSeverity.WARNING, conventions.timeout_text)
            self._upload = None
            if conventions.timeout_result is not None:
                self._ack(upload.partner, upload.mission_type, conventions.timeout_result)
        elif self._on.now - upload.asked_at >= conventions.request_interval:
            self._ask(upload)

    @property
    def _first_item(self) -> int:
        return 1 if self._conventions.home_is_item_0 else 0

    def _handle_count(self, message: messages.MissionCount, sender: Address) -> None:
        mission_type, conventions = message.mission_type, self._conventions
        if mission_type not in self._lists:
            self._ack(sender, mission_type, conventions.unknown_type)
        elif self._upload is not None and self._upload.partner != sender:
            self._ack(sender, mission_type, conventions.busy)
        elif message.count > conventions.capacity:
            if conventions.full_text is not None:
                self._outbox.say(MavSeverity.WARNING, conventions.full_text)
            self._ack(sender, mission_type, MavMissionResult.NO_SPACE)
        else:
            upload = _Upload(sender, mission_type, message.count, self._on.now, self._on.now)
            if message.count == 0:
                self._store(upload)
            else:
                self._upload = upload
                self._ask(upload)

    def _handle_item(self, message: Item, sender: Address) -> None:
        upload = self._upload
        if self._conventions.takes_guided_items and message.current == GUIDED_ITEM:
            self._go_to(message, sender)
        elif upload is None or upload.partner != sender:
            self._handle_stray_item(message, sender)
        elif message.seq != len(upload.items):
            if self._conventions.wrong_sequence is not None:
                self._ack(sender, upload.mission_type, self._conventions.wrong_sequence)
        elif refusal := self._refusal(message, upload.mission_type):
            self._upload = None
            self._ack(sender, upload.mission_type, refusal)
        else:
            upload.items.append(self._as_stored(message))
            upload.last_item_at = self._on.now
            if len(upload.items) == upload.count:
                self._store(upload)
            else:
                self._ask(upload)

    def _go_to(self, item: Item, sender: Address) -> None:
        """Drive to an item with current = 2, which older stations send; plans have none."""
        refusal = self._refusal(item, MISSION)
        if refusal is None:
            latitude, longitude = _place_of(item)
            place = Destination(*self._origin.to_local(round(latitude), round(longitude)))
            refusal = None if self._drive_to(place) else MavMissionResult.ERROR
        self._ack(sender, MISSION, refusal or MavMissionResult.ACCEPTED)

    def _handle_stray_item(self, message: Item, sender: Address) -> None:
        """Answer a repeated last item: a make with ids repeats its ack, others send an error."""
        last = self._stored
        repeated = last is not None and (last.partner, last.mission_type, last.count) == (
            sender,
            message.mission_type,
            message.seq + 1,
        )
        if repeated and self._conventions.has_ids:
            self._ack_plan(sender, message.mission_type)
        else:
            self._ack(sender, message.mission_type, MavMissionResult.ERROR)

    def _handle_request_list(self, message: messages.MissionRequestList, sender: Address) -> None:
        stored = self._lists.get(message.mission_type)
        if stored is None:
            self._ack(sender, message.mission_type, self._conventions.unknown_type)
        else:
            plan_id = self.plan_id(message.mission_type)
            self._outbox.send(
                messages.MissionCount(*sender, len(stored), message.mission_type, plan_id),
            )

    def _handle_request(self, message: Request, sender: Address) -> None:
        stored = self._lists.get(message.mission_type, [])
        if message.seq >= len(stored):
            self._ack(sender, message.mission_type, MavMissionResult.ERROR)
            return
        item = stored[message.seq]
        self._outbox.send(_item_for(sender, item, item.frame, item.x, item.y))

    def _handle_clear_all(self, message: messages.MissionClearAll, sender: Address) -> None:
        for mission_type, stored in self._lists.items():
            if message.mission_type in (mission_type, ALL):
                stored.clear()
                if mission_type == MISSION:
                    self._begin_anew()
        self._ack(sender, message.mission_type, MavMissionResult.ACCEPTED)

    def _handle_ack(self, message: messages.MissionAck, sender: Address) -> None:
        """End a cancelled upload; other acks end a download, which has no state here."""
        upload = self._upload
        if upload is None or upload.partner != sender:
            return
        if message.type == MavMissionResult.OPERATION_CANCELLED:
            self._upload = None

    def _store(self, upload: _Upload) -> None:
        self._lists[upload.mission_type] = upload.items
        if upload.mission_type == MISSION:
            self._begin_anew()
            if upload.items and self._conventions.home_is_item_0:
                self._put_home_first(upload.items)
        self._upload, self._stored = None, upload
        self._ack_plan(upload.partner, upload.mission_type)

    def _begin_anew(self) -> None:
        self.current = 0
        if self._conventions.goes_on:
            self.complete = False

    def _put_home_first(self, items: list[messages.MissionItemInt]) -> None:
        """Replace the uploaded item 0 by home."""
        origin = self._origin
        home = items[0]
        home.frame, home.command = MavFrame.GLOBAL, NAV_WAYPOINT
        home.x, home.y = origin.in_degrees_e7
        home.z = origin.altitude

    def _ask(self, upload: _Upload) -> None:
        upload.asked_at = self._on.now
        is_int = self._conventions.requests_int
        request = messages.MissionRequestInt if is_int else messages.MissionRequest
        self._outbox.send(request(*upload.partner, len(upload.items), upload.mission_type))

    def _ack_plan(self, partner: Address, mission_type: int) -> None:
        plan_id = self.plan_id(mission_type)
        self._outbox.send(
            messages.MissionAck(*partner, MavMissionResult.ACCEPTED, mission_type, plan_id)
        )

    def _ack(self, partner: Address, mission_type: int, result: MavMissionResult) -> None:
        self._outbox.send(messages.MissionAck(*partner, result, mission_type))

    def _refusal(self, item: Item, mission_type: int) -> MavMissionResult | None:
        if item.command not in self._conventions.storable[mission_type]:
            return MavMissionResult.UNSUPPORTED
        latitude, longitude = _place_of(item)
        if not is_on_earth(latitude, 0):
            return MavMissionResult.INVALID_PARAM5_X
        if not is_on_earth(0, longitude):
            return MavMissionResult.INVALID_PARAM6_Y
        return None

    def _as_stored(self, item: Item) -> messages.MissionItemInt:
        """Return an item in the INT form, in the frame in which this make returns it."""
        latitude, longitude = _place_of(item)
        frame = self._conventions.stored_frames.get(item.frame, item.frame)
        return _item_for(Address(0, 0), item, frame, round(latitude), round(longitude))


def _place_of(item: Item) -> tuple[float, float]:
    """Return latitude and longitude in degE7, from either form."""
    if isinstance(item, messages.MissionItem):
        return item.x * 1e7, item.y * 1e7
    return item.x, item.y


def _item_for(partner: Address, item: Item, frame: int, x: int, y: int) -> messages.MissionItemInt:
    return messages.MissionItemInt(
        *partner,
        item.seq,
        frame,
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


def _content(item: messages.MissionItemInt) -> bytes:
    """Return the bytes that identify an item, independent of its sender."""
    floats = (item.param1, item.param2, item.param3, item.param4, item.z)
    return pack("<5f2iHHB", *floats, item.x, item.y, item.seq, item.command, item.frame)
