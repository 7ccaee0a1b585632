"""The receiving end of plan uploads to one address, one at a time.

MAVLink guide, "Mission Protocol", "Upload a Mission to the Vehicle". It asks for each item until it
is there, and gives up before MAVSDK does (2.5 s), so that no request of ours reaches the client's
next upload. What an item is worth says ``check``; a plan counts only when it is whole and
``finish`` was called, which is when it is acknowledged.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from math import isnan
from typing import NamedTuple

from mav_tasks.latest import keep_latest
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavMissionResult
from mav_tasks.services.mission_item import Item, item_of

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
#: second one is in the other form
PATIENCE_PLAIN = 1
#: the same of MISSION_REQUEST_INT first: MAVSDK breaks off when a PX4 asks with MISSION_REQUEST, so
#: that this must not come of a packet or two that were lost
PATIENCE_INT = 4
INT_SENDERS = 64  # clients remembered that know MISSION_ITEM_INT
CAPACITY = 6_000  # items of one plan; to look at more would hold up a setpoint

#: why the receiver itself ends an upload
TAKEN = "another client is uploading: wait"
DISPLACED = "a client with a higher role is uploading: upload it again later"
TOO_MANY = f"more than {CAPACITY} items"
SILENT = f"no item came for {GIVE_UP:g} s: upload it again"
TOO_SLOW = f"took more than {LONGEST:g} s plus {EACH_ITEM:g} s per item: upload it again"

#: mission type, number, item, count -> why not, or None
Check = Callable[[int, int, Item, int], MavMissionResult | None]


class Sender(NamedTuple):
    """Who uploads: ``key`` tells clients apart, ``address`` is its own, ``addressed`` ours."""

    key: Hashable
    address: Address
    addressed: Address


class Upload(NamedTuple):
    """A whole plan, to be decided about; ``begun_at`` is of the first try, if some failed."""

    sender: Sender
    mission_type: int
    items: tuple[Item, ...]
    begun_at: float


class ToClient(NamedTuple):
    """A message to a client; ``why`` are words for an upload that the receiver itself has ended."""

    sender: Sender
    message: m.Message
    why: str = ""


class _InVain(NamedTuple):
    """Tries that came to nothing: their items, when the first began, and when the last ended."""

    items: tuple[Item, ...]
    begun_at: float
    ended_at: float


@dataclass(slots=True)
class _Session:
    sender: Sender
    mission_type: int
    count: int
    counted_at: float
    before: _InVain | None
    ask_at: float
    give_up_at: float
    over_at: float
    rank: int
    quiet_until: float  # until then come items of the upload before
    form: RequestForm  # that its client is known, or expected, to understand
    items: list[Item] = field(default_factory=list)
    last_form: RequestForm = m.MissionRequestInt  # of the last request
    asked: int = 0  # times, for the next item
    is_whole: bool = False

    @property
    def begun_at(self) -> float:
        """When the first try of this upload began; with other items it is another upload."""
        before = self.before
        if before is None or not _begin_alike(self.items, before.items):
            return self.counted_at
        return before.begun_at


class _Answered(NamedTuple):
    sender: Sender
    mission_type: int
    last: Item | None
    taken: int  # items, the last of them at most refused
    ack: m.MissionAck
    at: float


class MissionReceiver:
    """Takes in one upload; other clients are refused meanwhile, but for one of a higher rank.

    ``form``: how the autopilot at this address asks for items. Clients that wait for the other form
    only, as DroneKit for MISSION_REQUEST, are served by the repeats.
    """

    def __init__(self, *, check: Check, form: RequestForm) -> None:
        self._check = check
        self._form = form
        self._sends_int: dict[Sender, None] = {}
        self._session: _Session | None = None
        self._answered: _Answered | None = None
        self._ended: dict[tuple[Sender, int], float] = {}  # by mission type: when the last one did
        self._in_vain: dict[tuple[Sender, int], _InVain] = {}  # by mission type
        self._outgoing: list[ToClient] = []
        self._uploads: list[Upload] = []

    def __repr__(self) -> str:
        session = self._session
        words = "idle" if session is None else f"{len(session.items)} of {session.count} items"
        return f"MissionReceiver({words})"

    @property
    def items(self) -> Sequence[Item]:
        """The items of the upload under way that have come so far."""
        return self._session.items if self._session is not None else ()

    def take(self) -> tuple[list[ToClient], list[Upload]]:
        """Return what is to be sent, and the plans that are whole, since the last call."""
        outgoing, self._outgoing = self._outgoing, []
        uploads, self._uploads = self._uploads, []
        return outgoing, uploads

    def count(self, message: m.MissionCount, sender: Sender, *, now: float, rank: int = 0) -> None:
        """A client begins an upload, or begins it again; of a higher rank also instead of another.

        One that begins again gets no more time by that.
        """
        kind, session = message.mission_type, self._session
        is_another = session is not None and session.sender != sender
        if session is not None and is_another and (session.is_whole or session.rank >= rank):
            self._send_ack(sender, kind, MavMissionResult.DENIED, why=TAKEN)
            return
        if is_another:
            self._end(MavMissionResult.DENIED, None, why=DISPLACED, now=now)
            session = None
        if session is not None and session.is_whole:
            return  # it is being decided about
        if message.count > CAPACITY:
            self._session = None
            self._send_ack(sender, kind, MavMissionResult.NO_SPACE, why=TOO_MANY)
            return
        # Also a count that only seems to come again may be of another plan of that length: never
        # items of one upload with those of another.
        if session is not None:
            self._note_in_vain(session, now=now)
        before = self._in_vain.get((sender, kind))
        if before is not None and now - before.ended_at > ANOTHER_TRY:
            before = None
        quiet_until = self._quiet_until(sender, kind, now=now)
        self._session = _Session(
            sender,
            kind,
            message.count,
            now,
            before,
            ask_at=quiet_until,
            give_up_at=now + GIVE_UP,
            over_at=now + LONGEST if session is None else session.over_at,
            rank=rank,
            quiet_until=quiet_until,
            form=self._form,
        )
        self._answered = None
        self._advance(now=now)

    def item(
        self, message: m.MissionItemInt | m.MissionItem, sender: Sender, *, now: float
    ) -> None:
        """Take an item; one of no upload changes nothing."""
        session = self._session
        if session is None or session.sender != sender:
            self._repeat_answer(message, sender, now=now)
            return
        is_next = message.seq == len(session.items) and message.mission_type == session.mission_type
        if session.is_whole or now < session.quiet_until:
            return  # left from before
        if not is_next:  # one that was asked for twice
            if session.asked >= STEP_BACK and message.seq < len(session.items):
                session.ask_at = now + ASK_AGAIN
                self._request(session, message.seq + 1)
            return
        item = item_of(message)
        refusal: MavMissionResult | None = MavMissionResult.INVALID_PARAM5_X
        if item is not None:
            refusal = self._check(session.mission_type, message.seq, item, session.count)
        if refusal is not None or item is None:
            self._end(refusal or MavMissionResult.ERROR, item, now=now)
            return
        session.items.append(item)
        session.form = session.last_form
        if isinstance(message, m.MissionItemInt):
            keep_latest(self._sends_int, sender, None, most=INT_SENDERS)
        session.asked, session.ask_at, session.give_up_at = 0, now, now + GIVE_UP
        session.over_at += EACH_ITEM
        self._advance(now=now)

    def cancelled(self, message: m.MissionAck, sender: Sender, *, now: float) -> None:
        """A client's own ack: it gives its upload up, or has all of a download."""
        session = self._session
        if session is None or session.is_whole or message.type == MavMissionResult.ACCEPTED:
            return
        if (session.sender, session.mission_type) == (sender, message.mission_type):
            self._session = None
            self._note_in_vain(session, now=now)

    def end_gone(self, is_there: Callable[[Sender], object], *, now: float) -> None:
        """Give up an upload that is not whole if its client is gone: it keeps nobody out."""
        session = self._session
        if session is not None and not session.is_whole and not is_there(session.sender):
            self._session = None
            self._note_in_vain(session, now=now)

    def finish(self, result: MavMissionResult, *, opaque_id: int, now: float) -> None:
        """A whole plan has been decided about: tell the client."""
        session = self._session
        if session is None or not session.is_whole:
            return
        last = session.items[-1] if session.items else None
        self._end(result, last, opaque_id=opaque_id, now=now)

    def next_deadline(self) -> float | None:
        session = self._session
        if session is None or session.is_whole:
            return None
        return min(session.ask_at, session.give_up_at, session.over_at)

    def handle_deadline(self, *, now: float) -> None:
        """Ask again, and give up in the end."""
        session = self._session
        if session is None or session.is_whole:
            return
        if now >= min(session.give_up_at, session.over_at):
            why = SILENT if now >= session.give_up_at else TOO_SLOW
            self._end(MavMissionResult.OPERATION_CANCELLED, None, why=why, now=now)
        else:
            self._advance(now=now)

    def _advance(self, *, now: float) -> None:
        session = self._session
        assert session is not None, "an upload is under way"
        if len(session.items) == session.count:
            session.is_whole = True
            items = tuple(session.items)
            upload = Upload(session.sender, session.mission_type, items, session.begun_at)
            self._uploads.append(upload)
        elif now >= session.ask_at:
            session.ask_at = now + ASK_AGAIN
            session.asked += 1
            seq = len(session.items)
            # A late request takes MAVSDK back to that item, and then it answers none but the next.
            if session.asked >= STEP_BACK and session.asked % 2:
                seq = max(0, seq - session.asked // 2)
            self._request(session, seq)

    def _request(self, session: _Session, seq: int) -> None:
        sender = session.sender
        session.last_form = form = self._next_form(session)
        self._outgoing.append(ToClient(sender, form(*sender.address, seq, session.mission_type)))

    def _next_form(self, session: _Session) -> RequestForm:
        """Return the form for the next request: that of the autopilot; unanswered, also the other.

        DEVIATION: MISSION_REQUEST is deprecated in the guide, and ArduPilot sends nothing else.
        """
        is_int_first = self._form is m.MissionRequestInt
        if is_int_first and session.sender in self._sends_int:
            return m.MissionRequestInt
        beyond = session.asked - (PATIENCE_INT if is_int_first else PATIENCE_PLAIN)
        if beyond <= 0 or beyond % 2 == 0:
            return session.form
        return m.MissionRequest if session.form is m.MissionRequestInt else m.MissionRequestInt

    def _note_in_vain(self, session: _Session, refused: Item | None = None, *, now: float) -> None:
        """An upload came to nothing: its client will try again, and mean what it meant."""
        upload = (session.sender, session.mission_type)
        self._ended = {key: at for key, at in self._ended.items() if now - at <= LATE}
        self._ended[upload] = now
        self._in_vain = {
            key: tries
            for key, tries in self._in_vain.items()
            if now - tries.ended_at <= ANOTHER_TRY
        }
        items = (*session.items, *(() if refused is None else (refused,)))
        before = session.before
        if before is not None and _begin_alike(items, before.items):
            items = max(items, before.items, key=len)
        self._in_vain[upload] = _InVain(items, session.begun_at, now)

    def _quiet_until(self, sender: Sender, kind: int, *, now: float) -> float:
        """Return until when items may come that were sent before the count that came now."""
        ended_at = self._ended.get((sender, kind))
        return now if ended_at is None else max(now, min(now + QUIET, ended_at + LATE))

    def _end(
        self,
        result: MavMissionResult,
        last: Item | None,
        *,
        now: float,
        opaque_id: int = 0,
        why: str = "",
    ) -> None:
        session = self._session
        assert session is not None, "an upload is under way"
        self._session = None
        self._note_in_vain(session, None if session.is_whole else last, now=now)
        sender, kind = session.sender, session.mission_type
        if result == MavMissionResult.ACCEPTED:
            del self._in_vain[sender, kind]
        ack = self._send_ack(sender, kind, result, opaque_id=opaque_id, why=why)
        self._answered = _Answered(sender, kind, last, len(session.items), ack, now)

    def _repeat_answer(
        self, message: m.MissionItemInt | m.MissionItem, sender: Sender, *, now: float
    ) -> None:
        """The last item again: its sender has not heard what became of the plan."""
        answered = self._answered
        if answered is None or answered.sender != sender or now - answered.at > REPEATED:
            return
        is_last = message.seq in (answered.taken - 1, answered.taken)
        is_last = is_last and message.mission_type == answered.mission_type
        if is_last and item_of(message) == answered.last:
            self._outgoing.append(ToClient(sender, answered.ack))

    def _send_ack(
        self,
        sender: Sender,
        mission_type: int,
        result: MavMissionResult,
        *,
        opaque_id: int = 0,
        why: str = "",
    ) -> m.MissionAck:
        ack = m.MissionAck(*sender.address, result, mission_type, opaque_id)
        self._outgoing.append(ToClient(sender, ack, why))
        return ack


def _begin_alike(some: Sequence[Item], others: Sequence[Item]) -> bool:
    """Return whether two uploads have the same items, as far as both have come."""
    return all(_is_same(item, other) for item, other in zip(some, others, strict=False))


def _is_same(one: Item, other: Item) -> bool:
    """Return whether two items are equal; a parameter that is not given, NaN, is equal to NaN."""
    return one == other or all(
        a == b or (isnan(a) and isnan(b)) for a, b in zip(one, other, strict=True)
    )
