"""Plans that clients download: each sees the plan as it was when it asked for the list.

MAVLink guide, "Mission Protocol", "Download a Mission from the Vehicle".
"""

from collections.abc import Callable
from dataclasses import dataclass

from mav_tasks.latest import keep_latest
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavMissionResult
from mav_tasks.services.mission_item import Item, float_message_of, message_of
from mav_tasks.services.mission_receiver import RequestForm, Sender, ToClient

KEPT = 30.0  # s after its last request, in which a download may go on
MOST = 64  # downloads at once


@dataclass(slots=True)
class _Download:
    items: tuple[Item, ...]
    at: float


class MissionSender:
    """The downloads under way from one address."""

    def __init__(self) -> None:
        self._downloads: dict[tuple[Sender, int], _Download] = {}

    def __repr__(self) -> str:
        return f"MissionSender({len(self._downloads)} downloads)"

    def begin(
        self,
        sender: Sender,
        mission_type: int,
        items: tuple[Item, ...],
        *,
        opaque_id: int,
        now: float,
    ) -> ToClient:
        """A client asks for the list: give the count."""
        self._forget(now=now)
        download = _Download(items, now)
        keep_latest(self._downloads, (sender, mission_type), download, most=MOST)
        count = m.MissionCount(*sender.address, len(items), mission_type, opaque_id)
        return ToClient(sender, count)

    def request(
        self,
        sender: Sender,
        mission_type: int,
        seq: int,
        present: Callable[[], tuple[Item, ...]],
        *,
        now: float,
        form: RequestForm = m.MissionRequestInt,
    ) -> ToClient:
        """A client asks for an item: of its download, or of the ``present`` plan without one.

        It is answered in the ``form`` in which it asks: DroneKit reads nothing but MISSION_ITEM.
        """
        download = self._downloads.get((sender, mission_type))
        if download is None:
            self._forget(now=now)
            download = _Download(present(), now)
            keep_latest(self._downloads, (sender, mission_type), download, most=MOST)
        download.at = now
        if seq < len(download.items):
            make = message_of if form is m.MissionRequestInt else float_message_of
            return ToClient(sender, make(download.items[seq], seq, mission_type, to=sender.address))
        result = MavMissionResult.INVALID_SEQUENCE
        return ToClient(sender, m.MissionAck(*sender.address, result, mission_type))

    def end(self, sender: Sender, mission_type: int) -> None:
        """A client has all, or wants no more."""
        self._downloads.pop((sender, mission_type), None)

    def _forget(self, *, now: float) -> None:
        for key in [key for key, d in self._downloads.items() if now - d.at > KEPT]:
            del self._downloads[key]
