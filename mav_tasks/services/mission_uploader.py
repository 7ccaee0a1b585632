"""Sending a plan to a vehicle: our own end as a ground station.

MAVLink guide, "Mission Protocol", "Upload a Mission to the Vehicle". One plan at a time; what the
vehicle asks for decides what is sent, whichever of the two requests it asks with.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavMissionResult
from mav_tasks.services.mission_item import Item, message_of


@dataclass(frozen=True, slots=True)
class Patience:
    """How long an upload goes on; seconds."""

    count_again: float  # until the other end asks for something
    give_up: float  # without a request
    at_most: float  # in all
    #: without an answer to the last item, after which it is sent once more; None: never
    last_again: float | None = None


#: ArduPilot asks again after 1.0 s; MAVSDK waits 2.5 s for our own answer
TO_VEHICLE = Patience(count_again=0.25, give_up=1.2, at_most=2.0)


class Done(Protocol):
    """What is done when it is known what became of an upload.

    ``result`` None: the other end was silent. ``opaque_id`` is its id of the plan, 0 for none.
    """

    def __call__(self, result: MavMissionResult | None, *, opaque_id: int, now: float) -> None: ...


@dataclass(slots=True)
class _Upload:
    mission_type: int
    items: tuple[Item, ...]
    done: Done
    count_at: float = 0.0
    give_up_at: float = 0.0
    at_most_until: float = 0.0
    is_asked: bool = False
    is_sent: bool = False  # whole: its last item has been asked for and sent
    last_at: float | None = None  # when the last item is sent once more


class MissionUploader:
    """The plans on their way to one vehicle."""

    def __init__(
        self,
        target: Address,
        *,
        patience: Patience = TO_VEHICLE,
        fits: Callable[[int], bool] = lambda _opaque_id: True,
    ) -> None:
        """``fits`` says of an id in an accepting ack whether it can be this plan's."""
        self._target = target
        self._patience = patience
        self._fits = fits
        self._waiting: deque[_Upload] = deque()
        self._outgoing: list[m.Message] = []

    def __repr__(self) -> str:
        return f"MissionUploader({len(self._waiting)} to do)"

    def begin(self, mission_type: int, items: tuple[Item, ...], done: Done, *, now: float) -> None:
        """Send a plan, after those that are under way; ``done`` is called once."""
        self._waiting.append(_Upload(mission_type, items, done))
        if len(self._waiting) == 1:
            self._start(now=now)

    def receive(self, message: m.Message, *, now: float) -> None:
        """Take in what the vehicle says of an upload."""
        if not self._waiting:
            return
        upload = self._waiting[0]
        if getattr(message, "mission_type", upload.mission_type) != upload.mission_type:
            return
        match message:
            case m.MissionRequest() | m.MissionRequestInt() if message.seq < len(upload.items):
                upload.is_asked = True
                upload.give_up_at = min(now + self._patience.give_up, upload.at_most_until)
                self._send(upload, message.seq, now=now)
            case m.MissionAck() if self._is_answer(upload, message):
                known = [result for result in MavMissionResult if result == message.type]
                result = known[0] if known else MavMissionResult.ERROR
                self._end(result, opaque_id=message.opaque_id, now=now)

    def _is_answer(self, upload: _Upload, ack: m.MissionAck) -> bool:
        """Whether an ack can be of this upload: not one of an earlier one that comes late."""
        if ack.type != MavMissionResult.ACCEPTED:
            return True
        return (upload.is_sent or not upload.items) and self._fits(ack.opaque_id)

    def next_deadline(self) -> float | None:
        if not self._waiting:
            return None
        upload = self._waiting[0]
        again = upload.last_at if upload.is_asked else upload.count_at
        return upload.give_up_at if again is None else min(again, upload.give_up_at)

    def handle_deadline(self, *, now: float) -> None:
        """Offer it again, and give up in the end."""
        if not self._waiting:
            return
        upload = self._waiting[0]
        if now >= upload.give_up_at:
            self._end(None, opaque_id=0, now=now)
        elif upload.last_at is not None and now >= upload.last_at:
            self._send(upload, len(upload.items) - 1, now=now)
        elif not upload.is_asked and now >= upload.count_at:
            self._offer(upload, now=now)

    def take(self) -> list[m.Message]:
        """Return what is to be sent since the last call."""
        outgoing, self._outgoing = self._outgoing, []
        return outgoing

    def _start(self, *, now: float) -> None:
        upload = self._waiting[0]
        upload.give_up_at = now + self._patience.give_up
        upload.at_most_until = now + self._patience.at_most
        self._offer(upload, now=now)

    def _offer(self, upload: _Upload, *, now: float) -> None:
        upload.count_at = now + self._patience.count_again
        self._outgoing.append(m.MissionCount(*self._target, len(upload.items), upload.mission_type))

    def _send(self, upload: _Upload, seq: int, *, now: float) -> None:
        again = self._patience.last_again
        is_last = seq == len(upload.items) - 1
        upload.is_sent = upload.is_sent or is_last
        upload.last_at = now + again if again is not None and is_last else None
        item = upload.items[seq]
        self._outgoing.append(message_of(item, seq, upload.mission_type, to=self._target))

    def _end(self, result: MavMissionResult | None, *, opaque_id: int, now: float) -> None:
        upload = self._waiting.popleft()
        if self._waiting:
            self._start(now=now)
        upload.done(result, opaque_id=opaque_id, now=now)
