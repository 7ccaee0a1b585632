"""The autopilot's own mission, fence and rally storage: the vehicle side of the mission protocol.

MAVLink guide, "Mission Protocol"; ``MissionConventions`` has what it leaves open. The method for a
message has its name.
"""

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field
from struct import pack
from zlib import crc32

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavFrame, MavMissionResult, MavSeverity
from rover_sim.geo import is_on_earth
from rover_sim.onboard import Onboard
from rover_sim.route import Route, Waypoint
from rover_sim.setpoints import Destination

NAV_WAYPOINT = 16
GUIDED_ITEM = 2  # MISSION_ITEM.current
MISSION, FENCE, RALLY, ALL = 0, 1, 2, 255  # MAV_MISSION_TYPE
#: the MAV_CMDs that every make stores, by mission type: navigation, and "do"
STORED = {
    MISSION: {16, 17, 18, 19, 20, 42, 82, 83, 92, 93, 94, 112, 113, 114, 115, *range(177, 220)},
    FENCE: set(range(5000, 5005)),
    RALLY: {5100},
}
AIRBORNE = {21, 22, 31, 84, 85, 530, 531, 532, 1000, 1001, 2000, 2001, 2500, 2501}

Item = m.MissionItemInt | m.MissionItem


@dataclass(frozen=True, slots=True)
class MissionConventions:
    """One make's handling of missions, fences and rally points."""

    requests_int: bool  # items with MISSION_REQUEST_INT, not with MISSION_REQUEST
    capacity: int  # items of one list
    request_interval: float  # s between repeats of an unanswered request
    upload_timeout: float  # s without an item
    timeout_text: str
    busy: MavMissionResult  # to another client during an upload
    unknown_type: MavMissionResult
    stores_airborne: bool  # takes commands of aircraft and payloads, which a rover skips
    stored_frames: Mapping[int, int]  # frames that are stored as others
    home_is_item_0: bool  # an uploaded item 0 is replaced by home, and not driven to
    has_ids: bool  # opaque ids in MISSION_ACK, MISSION_COUNT and MISSION_CURRENT
    goes_on: bool  # AUTO resumes the mission instead of restarting it
    takes_guided_items: bool  # a lone item with current = 2 is a place to drive to now, in GUIDED
    timeout_result: MavMissionResult | None = None  # the ack that ends an upload; None: silence
    full_text: str = ""
    wrong_sequence: MavMissionResult | None = None  # to an unrequested item; None: silence


@dataclass(slots=True)
class _Upload:
    partner: Address
    mission_type: int
    count: int
    last_item_at: float
    asked_at: float
    items: list[m.MissionItemInt] = field(default_factory=list)


class MissionStorage:
    """Three lists of items and at most one upload. They survive a reboot."""

    def __init__(self, on: Onboard) -> None:
        self._on = on
        self._conventions = on.persona.missions
        self._first_item = 1 if self._conventions.home_is_item_0 else 0
        self._lists: dict[int, list[m.MissionItemInt]] = {MISSION: [], FENCE: [], RALLY: []}
        self._upload: _Upload | None = None
        self._stored: _Upload | None = None  # the last complete upload
        self.current = 0  # where AUTO resumes, on makes that resume
        self.complete = False  # AUTO reached the end of the mission

    def stored(self, mission_type: int) -> tuple[m.MissionItemInt, ...]:
        """Return the items of a plan, as a download would return them."""
        return tuple(self._lists[mission_type])

    @property
    def item_count(self) -> int:
        """Number of mission items, without home."""
        return max(0, len(self._lists[MISSION]) - self._first_item)

    def route(self) -> Route | None:
        """Return the stored mission's waypoints, or None if there are none."""
        waypoints = tuple(
            Waypoint(seq, Destination(*self._on.origin.to_local(item.x, item.y)))
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
        items = self._lists.get(mission_type)
        if not items or not self._conventions.has_ids:
            return 0
        return crc32(b"".join(_content(item) for item in items)) or 1

    def step(self) -> None:
        """Repeat an unanswered request; end the upload after its time-out."""
        upload, conventions, now = self._upload, self._conventions, self._on.now
        if upload is None:
            return
        if now - upload.last_item_at >= conventions.upload_timeout:
            self._on.outbox.say(MavSeverity.WARNING, conventions.timeout_text)
            self._end_upload(conventions.timeout_result)
        elif now - upload.asked_at >= conventions.request_interval:
            self._ask(upload)

    def _end_upload(self, result: MavMissionResult | None) -> None:
        upload, self._upload = self._upload, None
        if upload is not None and result is not None:
            self._ack(upload.partner, upload.mission_type, result)

    def on_mission_count(self, message: m.MissionCount, sender: Address) -> None:
        """Begin an upload."""
        mission_type, conventions, now = message.mission_type, self._conventions, self._on.now
        if mission_type not in self._lists:
            self._ack(sender, mission_type, conventions.unknown_type)
        elif self._upload is not None and self._upload.partner != sender:
            self._ack(sender, mission_type, conventions.busy)
        elif message.count > conventions.capacity:
            self._on.outbox.say(MavSeverity.WARNING, conventions.full_text)
            self._ack(sender, mission_type, MavMissionResult.NO_SPACE)
        else:
            self._upload = _Upload(sender, mission_type, message.count, now, now)
            self._go_on(self._upload)

    def on_mission_item_int(self, message: Item, sender: Address) -> None:
        """Take the next item of an upload, or a place to drive to now."""
        upload = self._upload
        if self._conventions.takes_guided_items and message.current == GUIDED_ITEM:
            self._go_to(message, sender)
        elif upload is None or upload.partner != sender:
            self._answer_stray_item(message, sender)
        elif message.seq != len(upload.items):
            if self._conventions.wrong_sequence is not None:
                self._ack(sender, upload.mission_type, self._conventions.wrong_sequence)
        elif refusal := self._refusal(message, upload.mission_type):
            self._end_upload(refusal)
        else:
            upload.items.append(self._as_stored(message))
            upload.last_item_at = self._on.now
            self._go_on(upload)

    on_mission_item = on_mission_item_int

    def _go_to(self, item: Item, sender: Address) -> None:
        """Drive to an item with current = 2, which older stations send; plans have none."""
        refusal, flight = self._refusal(item, MISSION), self._on.flight
        if refusal is None:
            place = Destination(*self._on.origin.to_local(*map(round, _place_of(item))))
            done = flight.can_reposition and flight.reposition(place)
            refusal = None if done else MavMissionResult.ERROR
        self._ack(sender, MISSION, refusal or MavMissionResult.ACCEPTED)

    def _answer_stray_item(self, message: Item, sender: Address) -> None:
        """Answer a repeated last item: a make with ids repeats its ack, others send an error."""
        last, this = self._stored, (sender, message.mission_type, message.seq + 1)
        repeated = last is not None and (last.partner, last.mission_type, last.count) == this
        is_fine = repeated and self._conventions.has_ids
        result = MavMissionResult.ACCEPTED if is_fine else MavMissionResult.ERROR
        self._ack(sender, message.mission_type, result)

    def on_mission_request_list(self, message: m.MissionRequestList, sender: Address) -> None:
        """Tell how many items a list has."""
        kind = message.mission_type
        stored = self._lists.get(kind)
        if stored is None:
            self._ack(sender, kind, self._conventions.unknown_type)
        else:
            self._send(m.MissionCount(*sender, len(stored), kind, self.plan_id(kind)))

    def on_mission_request_int(
        self, message: m.MissionRequestInt | m.MissionRequest, sender: Address
    ) -> None:
        """Send an item, always in the INT form."""
        stored = self._lists.get(message.mission_type, [])
        if message.seq >= len(stored):
            self._ack(sender, message.mission_type, MavMissionResult.ERROR)
            return
        item = copy(stored[message.seq])
        item.target_system, item.target_component = sender
        self._send(item)

    on_mission_request = on_mission_request_int

    def on_mission_clear_all(self, message: m.MissionClearAll, sender: Address) -> None:
        """Clear one list or all."""
        for mission_type, stored in self._lists.items():
            if message.mission_type in (mission_type, ALL):
                stored.clear()
                self._begin_anew(mission_type)
        self._ack(sender, message.mission_type, MavMissionResult.ACCEPTED)

    def on_mission_ack(self, message: m.MissionAck, sender: Address) -> None:
        """End a cancelled upload; other acks end a download, which has no state here."""
        is_over = message.type == MavMissionResult.OPERATION_CANCELLED
        if is_over and self._upload is not None and self._upload.partner == sender:
            self._upload = None

    def _go_on(self, upload: _Upload) -> None:
        """Request the next item, or store the upload if that was all."""
        if len(upload.items) < upload.count:
            self._ask(upload)
            return
        self._lists[upload.mission_type] = upload.items
        self._begin_anew(upload.mission_type)
        if upload.mission_type == MISSION and upload.items and self._conventions.home_is_item_0:
            home, origin = upload.items[0], self._on.origin
            home.frame, home.command = MavFrame.GLOBAL, NAV_WAYPOINT
            home.x, home.y = origin.in_degrees_e7
            home.z = origin.altitude
        self._upload, self._stored = None, upload
        self._ack(upload.partner, upload.mission_type, MavMissionResult.ACCEPTED)

    def _begin_anew(self, mission_type: int) -> None:
        if mission_type == MISSION:
            self.current = 0
            self.complete = self.complete and not self._conventions.goes_on

    def _ask(self, upload: _Upload) -> None:
        upload.asked_at = self._on.now
        request = m.MissionRequestInt if self._conventions.requests_int else m.MissionRequest
        self._send(request(*upload.partner, len(upload.items), upload.mission_type))

    def _ack(self, partner: Address, mission_type: int, result: MavMissionResult) -> None:
        plan_id = self.plan_id(mission_type) if result == MavMissionResult.ACCEPTED else 0
        self._send(m.MissionAck(*partner, result, mission_type, plan_id))

    def _send(self, message: m.Message) -> None:
        self._on.outbox.send(message)

    def _refusal(self, item: Item, mission_type: int) -> MavMissionResult | None:
        flies = mission_type == MISSION and self._conventions.stores_airborne
        if item.command not in STORED[mission_type] | (AIRBORNE if flies else set()):
            return MavMissionResult.UNSUPPORTED
        latitude, longitude = _place_of(item)
        if not is_on_earth(latitude, 0):
            return MavMissionResult.INVALID_PARAM5_X
        return None if is_on_earth(0, longitude) else MavMissionResult.INVALID_PARAM6_Y

    def _as_stored(self, item: Item) -> m.MissionItemInt:
        """Return an item in the INT form, in the frame in which this make returns it."""
        x, y = map(round, _place_of(item))
        frame = self._conventions.stored_frames.get(item.frame, item.frame)
        params = (item.param1, item.param2, item.param3, item.param4)
        what = (item.seq, frame, item.command, 0, item.autocontinue)
        return m.MissionItemInt(0, 0, *what, *params, x, y, item.z, item.mission_type)


def _place_of(item: Item) -> tuple[float, float]:
    """Return latitude and longitude in degE7, from either form."""
    scale = 1e7 if isinstance(item, m.MissionItem) else 1
    return item.x * scale, item.y * scale


def _content(item: m.MissionItemInt) -> bytes:
    """Return the bytes that identify an item, independent of its sender."""
    floats = (item.param1, item.param2, item.param3, item.param4, item.z)
    return pack("<5f2iHHB", *floats, item.x, item.y, item.seq, item.command, item.frame)
