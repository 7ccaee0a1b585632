"""Fetching a plan from a vehicle or a task server: the ground station's end.

MAVLink guide, "Mission Protocol", "Download a Mission from the Vehicle". One plan at a time.
"""

from dataclasses import dataclass, field
from typing import Protocol

from mav_tasks.engine.services.missions import Item, item_of
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavMissionResult

ASK_AGAIN = 0.3  # s, for the list or an item
GIVE_UP = 4.0  # s without anything that was asked for


class Done(Protocol):
    """What is done with a plan when it is there.

    ``items`` None: there is none to be had, because of ``refused``, or (None) of silence.
    """

    def __call__(
        self, items: tuple[Item, ...] | None, refused: MavMissionResult | None, *, now: float
    ) -> None: ...


@dataclass(slots=True)
class _Download:
    mission_type: int
    done: Done
    ask_at: float
    give_up_at: float
    count: int | None = None
    items: list[Item] = field(default_factory=list)


class MissionDownloader:
    """The plan that is being fetched from one component, if any."""

    def __init__(self, target: Address) -> None:
        self._target = target
        self._download: _Download | None = None
        self._outgoing: list[m.Message] = []

    def __repr__(self) -> str:
        return f"MissionDownloader({self._download})"

    def begin(self, mission_type: int, done: Done, *, now: float) -> None:
        """Fetch a plan; ``done`` is called once. There must be none under way."""
        assert self._download is None, "one at a time"
        self._download = _Download(mission_type, done, now, now + GIVE_UP)
        self._ask(self._download, now=now)

    def receive(self, message: m.Message, *, now: float) -> None:
        """Take in what the other end says of a download."""
        download = self._download
        if download is None or getattr(message, "mission_type", None) != download.mission_type:
            return
        match message:
            case m.MissionCount() if download.count is None:
                download.count = message.count
            case m.MissionItemInt() | m.MissionItem() if (
                download.count is not None and message.seq == len(download.items)
            ):
                item = item_of(message)
                if item is None:
                    return
                download.items.append(item)
            case m.MissionAck() if message.type != MavMissionResult.ACCEPTED:
                known = [result for result in MavMissionResult if result == message.type]
                self._end(None, known[0] if known else MavMissionResult.ERROR, now=now)
                return
            case _:
                return
        download.give_up_at = now + GIVE_UP
        if download.count == len(download.items):
            ack = m.MissionAck(*self._target, MavMissionResult.ACCEPTED, download.mission_type)
            self._outgoing.append(ack)
            self._end(tuple(download.items), None, now=now)
        else:
            self._ask(download, now=now)

    def next_deadline(self) -> float | None:
        download = self._download
        return None if download is None else min(download.ask_at, download.give_up_at)

    def handle_deadline(self, *, now: float) -> None:
        """Ask again, and give up in the end."""
        download = self._download
        if download is None:
            return
        if now >= download.give_up_at:
            self._end(None, None, now=now)
        elif now >= download.ask_at:
            self._ask(download, now=now)

    def take(self) -> list[m.Message]:
        """Return what is to be sent since the last call."""
        outgoing, self._outgoing = self._outgoing, []
        return outgoing

    def _ask(self, download: _Download, *, now: float) -> None:
        download.ask_at = now + ASK_AGAIN
        kind = download.mission_type
        self._outgoing.append(
            m.MissionRequestList(*self._target, kind)
            if download.count is None
            else m.MissionRequestInt(*self._target, len(download.items), kind)
        )

    def _end(
        self, items: tuple[Item, ...] | None, refused: MavMissionResult | None, *, now: float
    ) -> None:
        download, self._download = self._download, None
        assert download is not None
        download.done(items, refused, now=now)
