"""The I/O shell of a probe: a real link, one timer, signals. It decides nothing.

However the probe ends, it sends zero velocity, HOLD and disarming. Only after SIGKILL it cannot:
then the rover's own setpoint time-out must stop the rover.
"""

import asyncio
import signal
import time
from collections.abc import Callable

from mav_tasks.client.signatures import ClientSignatures
from mav_tasks.links.base import TEND_PERIOD, Link, Peer, PeerState, StreamLink
from mav_tasks.links.link_limits import TO_VEHICLES
from mav_tasks.links.policy import unsigned_beyond
from mav_tasks.links.url import parse_url
from mav_tasks.mavlink.packet import Packet, split_datagram
from mav_tasks.mavlink.signing import Key
from mav_tasks.mavlink.stream import StreamSplitter
from mav_tasks.probe.probe import Options, Probe

DRAIN = 64  # datagrams read before the loop has another turn
LAST_WORDS = 3  # times that the emergency stop packets are sent: a datagram may be lost


async def run_probe(
    url: str,
    options: Options,
    *,
    insecure: bool,
    key: Key | None = None,
    on_stage: Callable[[str], None],
) -> tuple[Probe, int]:
    """Probe the rover at a link; return the finished probe, and the number of a signal or 0.

    With a ``key`` the probe signs its packets and drops packets that are not signed with the key.
    ``on_stage`` is called with a text for each stage. Raise LinkUrlError, LinkOpenError or
    InsecureLinkError if the link cannot be used.
    """
    parsed = parse_url(url)
    if not (insecure or key is not None or parsed.is_nearby):
        raise unsigned_beyond(f"link {parsed}")
    link = parsed.open(limits=TO_VEHICLES)
    if link.note:
        on_stage(link.note)
    face = _Face(link, options, None if key is None else ClientSignatures(key), on_stage)
    try:
        await face.over
    finally:
        face.close()
    return face.probe, face.signal


class _Face:
    """The probe's driver: reads, arms one timer, sends."""

    def __init__(
        self,
        link: Link,
        options: Options,
        signatures: ClientSignatures | None,
        on_stage: Callable[[str], None],
    ) -> None:
        self._signatures = signatures
        self._loop = asyncio.get_running_loop()
        self._link = link
        self._on_stage = on_stage
        self._stage = ""
        self._peers: dict[Peer, None] = dict.fromkeys(link.peers)
        self._splitters: dict[Peer, StreamSplitter] = {}
        self._timer: asyncio.TimerHandle | None = None
        self._tending: asyncio.TimerHandle | None = None
        self.probe = Probe(options, now=self._loop.time())
        self.over: asyncio.Future[None] = self._loop.create_future()
        self.signal = 0
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            self._loop.add_signal_handler(number, self._on_signal, number)
        self._loop.add_reader(link.fileno(), self._on_readable)
        if isinstance(link, StreamLink):
            self._tend(link)
        self._on_timer()

    def __repr__(self) -> str:
        return f"_Face({self._link.name}, {self.probe!r})"

    def close(self) -> None:
        """Send the probe's emergency stop packets, if it has any, and close the link."""
        for timer in (self._timer, self._tending):
            if timer is not None:
                timer.cancel()
        self._send_last_words()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            self._loop.remove_signal_handler(number)
        self._loop.remove_reader(self._link.fileno())
        self._link.close()

    def _on_signal(self, number: int) -> None:
        if self.signal:  # a second signal ends at once; close() stops the rover
            self._finish()
            return
        self.signal = number
        words = f"ended by {signal.Signals(number).name}"
        self._guarded(lambda: self.probe.interrupt(words, now=self._loop.time()))

    def _on_timer(self) -> None:
        self._timer = None
        self._guarded(lambda: self.probe.handle_deadline(now=self._loop.time()))

    def _on_readable(self) -> None:
        self._guarded(self._read)

    def _read(self) -> None:
        if isinstance(self._link, StreamLink):
            self._take_changes(self._link)
        for peer, data in self._link.receive(DRAIN):
            for packet in filter(self._believes, self._packets(peer, data)):
                self._peers.setdefault(peer)
                self.probe.receive(packet, now=self._loop.time())
        if isinstance(self._link, StreamLink):
            self._take_changes(self._link)

    def _guarded(self, turn: Callable[[], None]) -> None:
        """Run a turn, send its packets, and arm the timer.

        If the turn raises, send the emergency stop packets and let ``run_probe`` raise the error.
        """
        if self.over.done():
            return
        try:
            turn()
            self._flush()
        except Exception as error:  # noqa: BLE001  # the rover must be stopped first
            self._send_last_words()
            self.over.set_exception(error)
            return
        if self.probe.is_over:
            self._finish()
            return
        if self.probe.stage != self._stage:
            self._stage = self.probe.stage
            self._on_stage(self._stage)
        due = self.probe.next_deadline()
        if self._timer is None or self._timer.when() != due:
            if self._timer is not None:
                self._timer.cancel()
            self._timer = self._loop.call_at(due, self._on_timer)

    def _flush(self) -> None:
        for data in self.probe.take_packets():
            self._send(data)

    def _send_last_words(self) -> None:
        for _ in range(LAST_WORDS):
            for data in self.probe.emergency_stop_packets():
                self._send(data)

    def _send(self, data: bytes) -> None:
        if self._signatures is not None:
            data = self._signatures.sealed(data, utc=time.time())
        for peer in self._peers:
            self._link.send(peer, data)

    def _believes(self, packet: Packet) -> bool:
        return self._signatures is None or self._signatures.believes(packet, utc=time.time())

    def _finish(self) -> None:
        if not self.over.done():
            self.over.set_result(None)

    def _packets(self, peer: Peer, data: bytes) -> list[Packet]:
        if not self._link.is_stream:
            return split_datagram(data)
        splitter = self._splitters.setdefault(peer, StreamSplitter())
        return splitter.feed(data, now=self._loop.time())

    def _take_changes(self, link: StreamLink) -> None:
        for change in link.take_changes():
            if change.state is PeerState.UP:
                self._peers.setdefault(change.peer)
            elif change.state is PeerState.DOWN:
                self._peers.pop(change.peer, None)
                self._splitters.pop(change.peer, None)

    def _tend(self, link: StreamLink) -> None:
        self._tending = self._loop.call_later(TEND_PERIOD, self._tend, link)
        link.poll()
        self._guarded(lambda: self._take_changes(link))
