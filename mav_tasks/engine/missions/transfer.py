"""The transfers of one plan type at one address: uploads, one at a time, and downloads.

MAVLink guide, "Mission Protocol". An upload asks for each item until it is there, and gives up
before MAVSDK does (2.5 s), so that no request of ours reaches the client's next upload. A plan
counts only when it is whole and ``finish`` was called, which is when it is acknowledged. A download
shows the plan as it was when the client asked for the list.
"""

from dataclasses import dataclass, field
from math import inf
from typing import NamedTuple

from mav_tasks.basics.errors import Rejection
from mav_tasks.basics.latest import keep_latest
from mav_tasks.config.settings import Settings
from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.clients.rights import Rights
from mav_tasks.engine.commands.assignments import Assignments
from mav_tasks.engine.commands.submissions import Submissions
from mav_tasks.engine.inputs import Place
from mav_tasks.engine.missions.plan_items import result_of
from mav_tasks.engine.missions.plan_table import MissionParseOptions
from mav_tasks.engine.missions.plans import MISSION, STORED, Plans, Stored
from mav_tasks.engine.services.missions import (
    CAPACITY,
    Item,
    count_of,
    float_message_of,
    item_at,
    item_of,
    message_of,
    packed,
)
from mav_tasks.engine.timers import Timers, Turn
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.kinds.params import bad
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavMissionResult
from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.goal import Step
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import ANY, Submitter

R = TaskReason

RequestForm = type[m.MissionRequest] | type[m.MissionRequestInt]
ASK_AGAIN = 0.2  # s, between requests for one item; MAVSDK loses least between 0.1 and 0.2
GIVE_UP = 2.3  # s without an item; MAVSDK gives up after 2.5
LONGEST = 60.0  # s, that an upload takes, and so keeps others out, at the most, besides
#: s for each item that has come: a radio of 57,600 baud that loses some takes 0.1 to 0.3
EACH_ITEM = 0.5
STEP_BACK = 3  # from so many requests for an item on each second one is for an earlier one
QUIET = 0.3  # s that a packet is on its way at the most
LATE = 2 * QUIET  # s after an upload has ended, in which items may still come that it asked for
REPEATED = 2.0  # s in which a last item that comes again is acknowledged again
#: s after an upload that came to nothing, in which the next one with its items is meant the same
ANOTHER_TRY = 10.0
#: requests for one item in the form that is known to be understood, or expected to be, before each
#: second one is in the other form. Of MISSION_REQUEST_INT first they are more: MAVSDK breaks off
#: when a PX4 asks with MISSION_REQUEST; this must not come of a packet or two that were lost
PATIENCE = {m.MissionRequest: 1, m.MissionRequestInt: 4}
INT_SENDERS = 64  # clients remembered that know MISSION_ITEM_INT
DOWNLOAD_KEPT = 30.0  # s after its last request, in which a download may go on
MOST_DOWNLOADS = 64  # at once

#: why an upload is refused or ended, but for its items
TAKEN = "upload: another client is uploading: wait"
DISPLACED = "upload: a client with a higher role is uploading: upload it again later"
TOO_MANY = f"upload: more than {CAPACITY} items"
SILENT = f"upload: no item came for {GIVE_UP:g} s: upload it again"
TOO_SLOW = f"upload: took more than {LONGEST:g} s plus {EACH_ITEM:g} s per item: upload it again"
#: MAV_MISSION_RESULTs that say more of these than their reason
RESULTS = {
    TOO_MANY: MavMissionResult.NO_SPACE,
    SILENT: MavMissionResult.OPERATION_CANCELLED,
    TOO_SLOW: MavMissionResult.OPERATION_CANCELLED,
}


@dataclass(repr=False, eq=False)
class MissionParts:
    """The parts of the server that transfers of plans work with."""

    gcs: GcsSide
    vehicles: VehicleSide
    registry: TaskRegistry
    submissions: Submissions
    assignments: Assignments
    plans: Plans
    timers: Timers
    settings: Settings
    #: the plans being stored, by vehicle and type: by whom, and whether that clears them
    storing: dict[tuple[int, int], tuple["Sender", bool]] = field(default_factory=dict)


class Sender(NamedTuple):
    """The client at the other end: its endpoint, the name of its key, and its address."""

    place: Place
    key: str
    address: Address


class _Past(NamedTuple):
    """How a client's last upload ended."""

    source: str = ""  # its items, of several tries in vain the most; none if it was accepted
    begun_at: float = inf  # when the first of these tries began
    ended_at: float = -inf
    taken: int = 0  # items, the last of them at most refused
    last: Item | None = None
    ack: m.MissionAck | None = None  # None: it had no answer


@dataclass(slots=True)
class Upload:
    """An upload under way."""

    sender: Sender
    #: the latest item's: later the endpoint may send for somebody else
    rights: Rights
    submitter: Submitter
    count: int
    counted_at: float
    over_at: float
    ask_at: float
    before: _Past
    form: RequestForm  # that its client is known, or expected, to understand
    give_up_at: float
    last_form: RequestForm = m.MissionRequestInt  # of the last request
    asked: int = 0  # times, for the next item
    items: list[Item] = field(default_factory=list)
    #: what becomes of the items, each parsed once, as it takes time; and how they were parsed
    steps: list[Step] = field(default_factory=list)
    parsed_by: MissionParseOptions | None = None

    @property
    def is_whole(self) -> bool:
        """Whether all items have come: it is being decided about."""
        return len(self.items) == self.count

    @property
    def begun_at(self) -> float:
        """When the first try of this upload began; with other items it is another upload."""
        is_same = _begin_alike(packed(self.items), self.before.source)
        return min(self.counted_at, self.before.begun_at) if is_same else self.counted_at


class Transfer:
    """The uploads and downloads of one plan type at one address.

    While one client uploads, others are refused, but for one of a higher rank.
    """

    def __init__(
        self, parts: MissionParts, vehicle: Vehicle | None, address: Address, kind: int
    ) -> None:
        """``vehicle`` None: the plans are for any vehicle."""
        self.parts = parts
        self.vehicle = vehicle
        self.address = address
        self.kind = kind
        self.is_staged = vehicle is not None and address.component_id == AUTOPILOT
        self.upload: Upload | None = None
        #: requests an item again, or ends the upload after its time-out
        self.timer = parts.timers.timer(Turn.UPLOADS, self._ask_again)
        is_plain = self.is_staged and vehicle and not vehicle.persona.has_int_requests
        #: how the autopilot at this address asks for items. Clients that wait for the other form
        #: only, as DroneKit for MISSION_REQUEST, are served by the repeats.
        self._form: RequestForm = m.MissionRequest if is_plain else m.MissionRequestInt
        self._sends_int: dict[Sender, None] = {}
        self._past: dict[Sender, _Past] = {}
        self._downloads: dict[Sender, tuple[str, float]] = {}  # items, and when it went on

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.address}, type {self.kind}, {self.upload})"

    def check(self, upload: Upload, item: Item) -> None:
        """Raise Rejection if an item may not be the next one of an upload."""
        raise NotImplementedError

    def decide(self, upload: Upload, *, now: float) -> None:
        """Submit or store a whole upload, and ``finish`` it. Raise Rejection if it is refused."""
        raise NotImplementedError

    def present(self) -> Stored:
        """Return the plan to download."""
        raise NotImplementedError

    # answers

    def client(self, sender: Sender) -> GcsClient | None:
        """Return the client at the other end, None if it is gone."""
        return self.parts.gcs.client(sender.place)

    def send(self, sender: Sender, message: m.Message) -> None:
        """Send a message in the name of the address that the client addressed."""
        if client := self.client(sender):
            client.outlet.send(message, self.address)

    def ack(self, sender: Sender, result: MavMissionResult, opaque_id: int = 0) -> m.MissionAck:
        """Send a MISSION_ACK with a plan's id, or the reason of a refusal; return it."""
        ack = m.MissionAck(*sender.address, result, self.kind, opaque_id)
        self.send(sender, ack)
        return ack

    def answer(
        self, sender: Sender, answer: Rejection | int, *, now: float, message_id: int = 0
    ) -> m.MissionAck:
        """Accept a request with the plan's id, or refuse it, with a text and a record."""
        if isinstance(answer, int):
            return self.ack(sender, MavMissionResult.ACCEPTED, answer)
        ack = self.ack(sender, RESULTS.get(answer.text) or result_of(answer), answer.reason)
        self.tell_refusal(sender, answer, message_id=message_id, now=now)
        return ack

    def tell_refusal(
        self, sender: Sender, refusal: Rejection, *, now: float, message_id: int
    ) -> None:
        """Tell the client why a request was refused, and record it; ``message_id`` 0: an upload."""
        client, vehicle = self.client(sender), self.vehicle
        if client is not None:
            if not client.may_be_refused(now=now):
                return  # a flood of refusals fills neither disk nor network
            by = vehicle.server_address if vehicle else self.parts.vehicles.our_address
            client.tell_refusal(refusal.text, by, now=now)
        number, reason = vehicle.system_id if vehicle else ANY, TaskReason(refusal.reason)
        self.parts.registry.record(
            SubmissionRefused(number, -message_id, reason, refusal.text, str(sender.address), now)
        )

    # downloads

    def offer(self, sender: Sender, *, now: float) -> None:
        """A client asks for the list: send the count."""
        if self.kind not in STORED:
            self.ack(sender, MavMissionResult.UNSUPPORTED)
            return
        plan_id, source = self.present()
        keep_latest(self._downloads, sender, (source, now), most=MOST_DOWNLOADS)
        count = m.MissionCount(*sender.address, count_of(source), self.kind, plan_id)
        self.send(sender, count)

    def give(
        self, sender: Sender, message: m.MissionRequest | m.MissionRequestInt, *, now: float
    ) -> None:
        """A client asks for an item: of its download, or of the present plan without one.

        It is answered in the form in which it asks: DroneKit reads nothing but MISSION_ITEM.
        """
        source, at = self._downloads.get(sender, ("", -inf))
        if now - at > DOWNLOAD_KEPT:
            source = self.present().source
        keep_latest(self._downloads, sender, (source, now), most=MOST_DOWNLOADS)
        if message.seq >= count_of(source):
            self.ack(sender, MavMissionResult.INVALID_SEQUENCE)
            return
        make = message_of if isinstance(message, m.MissionRequestInt) else float_message_of
        item = item_at(source, message.seq)
        self.send(sender, make(item, message.seq, self.kind, to=sender.address))

    # uploads

    def begin(
        self, message: m.MissionCount, sender: Sender, *, client: GcsClient, now: float
    ) -> None:
        """A client begins an upload, or begins it again; of a higher rank also instead of another.

        One that begins again gets no more time by that. Raise Rejection if it is refused.
        """
        if self.kind not in (STORED if self.vehicle else (MISSION,)):
            is_known = self.kind in STORED
            why = "belongs to one rover: name it" if is_known else "is not supported"
            words = f"upload: mission type {self.kind} {why}"
            raise Rejection(R.NOT_SUPPORTED_BY_VEHICLE, words)
        upload, over_at = self.upload, now + LONGEST
        if upload is not None:
            is_gone = self.client(upload.sender) is None
            if upload.sender == sender:
                if upload.is_whole:
                    return
                # Also a count that only seems to come again may be of another plan of that length:
                # never items of one upload with those of another.
                over_at = upload.over_at
                self._leave(upload, now=now)
            elif upload.is_whole or (upload.rights.rank >= client.rights.rank and not is_gone):
                raise Rejection(R.WRONG_STATE, TAKEN)
            elif is_gone:  # it keeps nobody out
                self._leave(upload, now=now)
            else:
                self._end(upload, Rejection(R.WRONG_STATE, DISPLACED), now=now)
        if message.count > CAPACITY:
            raise Rejection(R.QUEUE_FULL, TOO_MANY)
        before = self._past.get(sender, _Past())
        if now - before.ended_at > ANOTHER_TRY:
            before = _Past()
        self.upload = Upload(
            sender,
            client.rights,
            client.who,
            message.count,
            counted_at=now,
            over_at=over_at,
            # after the upload before its items may still come
            ask_at=max(now, min(now + QUIET, before.ended_at + LATE)),
            before=before,
            form=self._form,
            give_up_at=now + GIVE_UP,
        )
        self._advance(self.upload, now=now)

    def take(
        self,
        message: m.MissionItemInt | m.MissionItem,
        sender: Sender,
        *,
        client: GcsClient,
        now: float,
    ) -> None:
        """Take an item; one of no upload changes nothing."""
        upload, seq, item = self.upload, message.seq, item_of(message)
        if upload is None or upload.sender != sender:
            past = self._past.get(sender, _Past())
            is_last = seq in (past.taken - 1, past.taken) and item == past.last
            if past.ack and is_last and now - past.ended_at <= REPEATED:
                self.send(sender, past.ack)  # it has not heard what became of the plan
            return
        if upload.is_whole or not upload.asked or seq > len(upload.items):
            return  # left from before
        if seq < len(upload.items):
            if upload.asked >= STEP_BACK:  # it was asked for twice
                upload.ask_at = now + ASK_AGAIN
                self._request(upload, seq + 1)
            return
        try:
            if item is None:
                raise bad("upload: an item cannot be read", param=5)
            self.check(upload, item)
        except Rejection as refusal:
            self._end(upload, refusal, item, now=now)
            return
        upload.items.append(item)
        upload.rights, upload.submitter = client.rights, client.who
        upload.form = upload.last_form
        if isinstance(message, m.MissionItemInt):
            keep_latest(self._sends_int, upload.sender, None, most=INT_SENDERS)
        upload.asked, upload.ask_at, upload.give_up_at = 0, now, now + GIVE_UP
        upload.over_at += EACH_ITEM
        self._advance(upload, now=now)

    def end(self, message: m.MissionAck, sender: Sender, *, now: float) -> None:
        """A client's own ack: it gives its upload up, or has all of a download."""
        self._downloads.pop(sender, None)
        upload = self.upload
        is_given_up = message.type != MavMissionResult.ACCEPTED
        if is_given_up and upload and upload.sender == sender and not upload.is_whole:
            self._leave(upload, now=now)

    def finish(self, answer: Rejection | int, /, *, now: float) -> None:
        """Answer a whole upload, which has been decided about: with a plan's id, or a refusal."""
        upload = self.upload
        if upload is not None and upload.is_whole:
            self._end(upload, answer, *upload.items[-1:], now=now)
            self.plan_timer()

    def decide_or_refuse(self, upload: Upload, *, now: float) -> None:
        """Decide about a whole upload, perhaps held back before."""
        try:
            self.decide(upload, now=now)
        except Rejection as refusal:
            self.finish(refusal, now=now)

    def _ask_again(self, *, now: float) -> None:
        """Ask again, and give up in the end."""
        upload = self.upload
        if upload is not None and not upload.is_whole:
            if now >= upload.give_up_at:
                self._end(upload, Rejection(R.WRONG_STATE, SILENT), now=now)
            elif now >= upload.over_at:
                self._end(upload, Rejection(R.WRONG_STATE, TOO_SLOW), now=now)
            else:
                self._advance(upload, now=now)
        self.plan_timer()

    def plan_timer(self) -> None:
        """Set the timer to what is due next."""
        upload, at = self.upload, inf
        if upload is not None and not upload.is_whole:
            at = min(upload.ask_at, upload.give_up_at, upload.over_at)
        self.timer.set(at)

    def _advance(self, upload: Upload, *, now: float) -> None:
        if upload.is_whole:
            self.decide_or_refuse(upload, now=now)
        elif now >= upload.ask_at:
            upload.ask_at = now + ASK_AGAIN
            upload.asked += 1
            seq = len(upload.items)
            # A late request takes MAVSDK back to that item, and then it answers none but the next.
            if upload.asked >= STEP_BACK and upload.asked % 2:
                seq = max(0, seq - upload.asked // 2)
            self._request(upload, seq)

    def _request(self, upload: Upload, seq: int) -> None:
        """Ask for an item in the form of the autopilot; unanswered, also in the other one.

        DEVIATION: MISSION_REQUEST is deprecated in the guide, and ArduPilot sends nothing else.
        """
        form, beyond = upload.form, upload.asked - PATIENCE[self._form]
        if self._form is m.MissionRequestInt and upload.sender in self._sends_int:
            form = m.MissionRequestInt
        elif beyond > 0 and beyond % 2:
            form = m.MissionRequest if form is m.MissionRequestInt else m.MissionRequestInt
        upload.last_form = form
        self.send(upload.sender, form(*upload.sender.address, seq, self.kind))

    def _end(
        self, upload: Upload, answer: Rejection | int, last: Item | None = None, *, now: float
    ) -> None:
        ack = self.answer(upload.sender, answer, now=now)
        self._leave(upload, last, ack, now=now)

    def _leave(
        self,
        upload: Upload,
        last: Item | None = None,
        ack: m.MissionAck | None = None,
        *,
        now: float,
    ) -> None:
        """End an upload; if it came to nothing, its client will try again, and mean the same."""
        self.upload = None
        past = {key: each for key, each in self._past.items() if now - each.ended_at <= ANOTHER_TRY}
        source, begun_at = "", inf
        if ack is None or ack.type:
            begun_at = upload.begun_at
            refused = [last] if last and not upload.is_whole else []
            source = packed(upload.items + refused)
            if _begin_alike(source, upload.before.source):
                source = max(source, upload.before.source, key=len)
        past[upload.sender] = _Past(source, begun_at, now, len(upload.items), last, ack)
        self._past = past


def _begin_alike(one: str, other: str) -> bool:
    """Return whether two uploads have the same items, as far as both have come."""
    return one.startswith(other) or other.startswith(one)
