"""Uploads and downloads of plans: one at a time per component, retried while that is safe. Pure.

A failed upload is repeated with the same bytes: within 10 s of the last try the server treats it as
the same upload. While another client uploads, the server refuses at once; the upload is then tried
again after BUSY_AGAIN.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import inf

from mav_tasks.client.mission_downloader import MissionDownloader
from mav_tasks.engine.services.missions import Item, MissionUploader, Patience
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavMissionResult
from mav_tasks.tasks.lifecycle import TaskReason

#: the server gives up after 2.3 s without an item
PATIENCE = Patience(count_again=0.5, give_up=2.6, at_most=60.0, last_again=0.5)
TRIES = 4
#: reasons of a refusal because another client uploads; 0: of an older server
BUSY = (TaskReason.NONE, TaskReason.WRONG_STATE)
BUSY_AGAIN = 0.25  # s until the next try while another client uploads
BUSY_WITHIN = 10.0  # s for which such tries continue
REST = 0.6  # s after a refusal for which its copies may still arrive
LATE = 3.0  # s after an upload for which copies of its ack may still arrive

MESSAGES = (
    m.MissionAck,
    m.MissionCount,
    m.MissionItem,
    m.MissionItemInt,
    m.MissionRequest,
    m.MissionRequestInt,
)

#: MAV_MISSION_RESULT, None after a time-out; the plan's id, or the reason of a refusal
Uploaded = Callable[[MavMissionResult | None, int], None]
Downloaded = Callable[[tuple[Item, ...] | None, MavMissionResult | None], None]


@dataclass(slots=True)
class _Upload:
    mission_type: int
    items: tuple[Item, ...]
    done: Uploaded
    tries: int = 0
    is_asked: bool = False  # the server has requested an item
    give_way_until: float = 0.0


@dataclass(slots=True)
class _Download:
    mission_type: int
    done: Downloaded


class Transfers:
    """The uploads and downloads of one component."""

    def __init__(self, target: Address) -> None:
        self.target = target
        self._uploader = MissionUploader(target, patience=PATIENCE, fits=self._fits)
        self._downloader = MissionDownloader(target)
        self._waiting: deque[_Upload | _Download] = deque()
        self._uploaded: dict[int, tuple[_Upload, float]] = {}  # by id; until when acks may arrive
        self._now = 0.0
        self._rests_until: float | None = None

    def __repr__(self) -> str:
        return f"Transfers({self.target}, {len(self._waiting)} to do)"

    def upload(
        self, mission_type: int, items: tuple[Item, ...], done: Uploaded, *, now: float
    ) -> None:
        """Upload a plan. Call ``done`` once."""
        self._begin(_Upload(mission_type, items, done), now=now)

    def drop(self, done: Uploaded) -> None:
        """Abandon an upload: remove it if it has not started.

        A started upload continues but is not retried: the server may have the plan already.
        """
        for upload in list(self._waiting):
            if isinstance(upload, _Upload) and upload.done is done:
                upload.tries = TRIES
                if upload is not self._waiting[0] or self._rests_until is not None:
                    self._waiting.remove(upload)

    def download(self, mission_type: int, done: Downloaded, *, now: float) -> None:
        """Download a plan. Call ``done`` once."""
        self._begin(_Download(mission_type, done), now=now)

    def receive(self, message: m.Message, *, now: float) -> None:
        """Process a mission message of the component."""
        self._now = now
        if not self._waiting or self._rests_until is not None:
            return
        transfer = self._waiting[0]
        if isinstance(transfer, _Upload):
            transfer.is_asked |= isinstance(message, m.MissionRequest | m.MissionRequestInt)
            self._uploader.receive(message, now=now)
        else:
            self._downloader.receive(message, now=now)

    def next_deadline(self) -> float | None:
        """Return when to call ``handle_deadline``; None: nothing is pending."""
        begin_at = self._rests_until if self._waiting else None
        upload = self._uploader
        due = (upload.again_at, upload.give_up_at, self._downloader.next_deadline(), begin_at)
        return min((at for at in due if at is not None and at < inf), default=None)

    def handle_deadline(self, *, now: float) -> None:
        """Repeat what is due, and start the next transfer."""
        self._uploader.handle_deadline(now=now)
        self._downloader.handle_deadline(now=now)
        if self._rests_until is not None and now >= self._rests_until:
            self._rests_until = None
            if self._waiting:
                self._start(now=now)

    def take(self) -> list[m.Message]:
        """Return the messages to send since the last call."""
        return self._downloader.take() + self._uploader.take()

    def _fits(self, opaque_id: int) -> bool:
        """Return whether an id can be this upload's: not if another plan just got it."""
        upload = self._waiting[0]
        assert isinstance(upload, _Upload)
        earlier, until = self._uploaded.get(opaque_id, (upload, 0.0))
        is_same = (earlier.mission_type, earlier.items) == (upload.mission_type, upload.items)
        return is_same or self._now >= until

    def _begin(self, transfer: _Upload | _Download, *, now: float) -> None:
        self._waiting.append(transfer)
        if self._rests_until is not None and now >= self._rests_until:
            self._rests_until = None
        if len(self._waiting) == 1 and self._rests_until is None:
            self._start(now=now)

    def _start(self, *, now: float) -> None:
        transfer = self._waiting[0]
        if isinstance(transfer, _Upload):
            transfer.tries += 1
            transfer.give_way_until = transfer.give_way_until or now + BUSY_WITHIN
            self._uploader.begin(transfer.mission_type, transfer.items, self._tried, now=now)
        else:
            self._downloader.begin(transfer.mission_type, self._fetched, now=now)

    def _tried(self, result: MavMissionResult | None, *, opaque_id: int, now: float) -> None:
        upload = self._waiting[0]
        assert isinstance(upload, _Upload)
        is_busy = result == MavMissionResult.DENIED and opaque_id in BUSY
        is_others_turn = is_busy and upload.items and not upload.is_asked
        if is_others_turn and upload.tries < TRIES and now < upload.give_way_until:
            upload.tries -= 1
            self._rests_until = now + BUSY_AGAIN
            return
        is_in_vain = result in (None, MavMissionResult.OPERATION_CANCELLED)
        if is_in_vain and upload.tries < TRIES:
            self._start(now=now)
            return
        self._uploaded = {k: v for k, v in self._uploaded.items() if now < v[1]}
        if result == MavMissionResult.ACCEPTED:
            self._uploaded[opaque_id] = upload, now + LATE
        elif result is not None:
            self._rests_until = now + REST
        self._end(now=now)
        upload.done(result, opaque_id)

    def _fetched(
        self, items: tuple[Item, ...] | None, refused: MavMissionResult | None, *, now: float
    ) -> None:
        download = self._waiting[0]
        assert isinstance(download, _Download)
        if refused is not None:
            self._rests_until = now + REST
        self._end(now=now)
        download.done(items, refused)

    def _end(self, *, now: float) -> None:
        self._waiting.popleft()
        if self._waiting and self._rests_until is None:
            self._start(now=now)
