"""Sending a plan to a vehicle: our own end as a ground station.

MAVLink guide, "Mission Protocol", "Upload a Mission to the Vehicle". One plan at a time; what the
vehicle asks for decides what is sent, whichever of the two requests it asks with.
"""

from collections import deque
from dataclasses import dataclass
from typing import Protocol

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavMissionResult
from mav_tasks.services.mission_item import Item, message_of

COUNT_AGAIN = 0.25  # s, until the vehicle asks for something
GIVE_UP = 1.2  # s without a request; ArduPilot asks again after 1.0
AT_MOST = 2.0  # s in all: MAVSDK waits 2.5 for our own answer


class Done(Protocol):
    """What is done when it is known what became of an upload; None: the vehicle was silent."""

    def __call__(self, result: MavMissionResult | None, *, now: float) -> None: ...


@dataclass(slots=True)
class _Upload:
    mission_type: int
    items: tuple[Item, ...]
    done: Done
    count_at: float = 0.0
    give_up_at: float = 0.0
    at_most_until: float = 0.0
    is_asked: bool = False


class MissionUploader:
    """The plans on their way to one vehicle."""

    def __init__(self, target: Address) -> None:
        self._target = target
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
                upload.give_up_at = min(now + GIVE_UP, upload.at_most_until)
                item = upload.items[message.seq]
                self._outgoing.append(
                    message_of(item, message.seq, upload.mission_type, to=self._target)
                )
            case m.MissionAck():
                known = [result for result in MavMissionResult if result == message.type]
                self._end(known[0] if known else MavMissionResult.ERROR, now=now)

    def next_deadline(self) -> float | None:
        """Give when ``handle_deadline`` has something to do."""
        if not self._waiting:
            return None
        upload = self._waiting[0]
        return upload.give_up_at if upload.is_asked else min(upload.count_at, upload.give_up_at)

    def handle_deadline(self, *, now: float) -> None:
        """Offer it again, and give up in the end."""
        if not self._waiting:
            return
        upload = self._waiting[0]
        if now >= upload.give_up_at:
            self._end(None, now=now)
        elif not upload.is_asked and now >= upload.count_at:
            self._offer(upload, now=now)

    def take(self) -> list[m.Message]:
        """Give what is to be sent since the last call."""
        outgoing, self._outgoing = self._outgoing, []
        return outgoing

    def _start(self, *, now: float) -> None:
        upload = self._waiting[0]
        upload.give_up_at = now + GIVE_UP
        upload.at_most_until = now + AT_MOST
        self._offer(upload, now=now)

    def _offer(self, upload: _Upload, *, now: float) -> None:
        upload.count_at = now + COUNT_AGAIN
        self._outgoing.append(m.MissionCount(*self._target, len(upload.items), upload.mission_type))

    def _end(self, result: MavMissionResult | None, *, now: float) -> None:
        upload = self._waiting.popleft()
        if self._waiting:
            self._start(now=now)
        upload.done(result, now=now)
