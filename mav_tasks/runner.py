"""The I/O shell: one loop, one timer, one pump; signals and the orderly end. It decides nothing.

What must be durable first the engine holds back by itself: whatever ``take_packets`` gives may
leave at once, and so it leaves before the events of the same turn reach the store.
"""

import asyncio
import logging
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import inf

from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import (
    Committed,
    Congestion,
    Input,
    LinkChanged,
    LinkSide,
    Outgoing,
    Packets,
    Peer,
    PeerChanged,
    Shutdown,
    StoreFailed,
    WallClock,
)
from mav_tasks.links.base import TEND_PERIOD, Link, PeerChange, PeerState, StreamLink
from mav_tasks.store import Kept, NotKept, Outcome, Store
from mav_tasks.tasks.events import (
    Event,
    QueuePaused,
    ServerStopped,
    SubmissionRefused,
    VehicleNoted,
)

log = logging.getLogger("mav_tasks")

DRAIN = 64  # datagrams read from one link before the others have their turn
AT_A_TIME = 8  # of them, taken in even when a setpoint is due
EACH_TAKES = 1e-4  # s, about, to take one in: so many are, before the time asks for something
WALL_STEP = 0.5  # s, a change of the wall clock's offset that is reported

EXIT_FAILED = 70  # EX_SOFTWARE: the engine itself failed


class Pump:
    """Engine, store and links, turned by whoever knows the time."""

    def __init__(self, engine: Engine, store: Store, send: Callable[[Outgoing], None]) -> None:
        self.engine = engine
        self._store = store
        self._send = send
        self._store_is_away = False
        self.is_over = False

    def handle(self, item: Input, *, now: float) -> None:
        """Take one input in; ``turn`` brings out what follows."""
        self.engine.handle(item, now=now)

    def handle_deadline(self, *, now: float) -> None:
        """Do what the time asks for; ``turn`` brings out what follows."""
        self.engine.handle_deadline(now=now)

    def turn(self, *, now: float) -> None:
        """Send and store until nothing is left to do."""
        noted: list[Event] = []
        while True:
            for outgoing in self.engine.take_packets():
                self._send(outgoing)
            events = self.engine.take_events()
            if events:
                self._store.append(events)
                noted += events
            outcomes = self._store.take_outcomes()
            if not outcomes:
                break
            for outcome in outcomes:
                self._note_outcome(outcome)
                self.engine.handle(
                    Committed(outcome.through)
                    if isinstance(outcome, Kept)
                    else StoreFailed(outcome.text),
                    now=now,
                )
        self._note(noted)  # last: whoever waits for an answer does not wait for the log

    def send_last_words(self) -> None:
        """Stop every vehicle that is being driven, without asking the engine anything."""
        for outgoing in self.engine.last_words:
            with suppress(Exception):  # what fails for one must not keep it from the next
                self._send(outgoing)

    def _note_outcome(self, outcome: Outcome) -> None:
        if isinstance(outcome, NotKept):
            log.error("%s: submissions are refused until it is mended", outcome.text)
        elif self._store_is_away:
            log.warning("the store takes events again")
        self._store_is_away = isinstance(outcome, NotKept)

    def _note(self, events: list[Event]) -> None:
        for event in events:
            noteworthy = isinstance(event, SubmissionRefused | VehicleNoted | QueuePaused)
            log.log(logging.WARNING if noteworthy else logging.INFO, "%s", event)
            if isinstance(event, ServerStopped):
                self.is_over = True


def link_changed(link: Link, side: LinkSide) -> LinkChanged:
    """Give the input that says that a link is up."""
    return LinkChanged(
        link.name,
        side,
        up=True,
        peers=link.peers,
        is_local=link.is_local,
        is_stream=link.is_stream,
    )


def peer_changed(link: Link, change: PeerChange) -> PeerChanged | Congestion:
    """Give the input that says what became of a peer."""
    match change.state:
        case PeerState.UP | PeerState.DOWN as state:
            return PeerChanged(link.name, change.peer, up=state is PeerState.UP)
        case state:
            return Congestion(link.name, change.peer, is_congested=state is PeerState.CONGESTED)


class Runner:
    """Runs an engine on real links until a signal ends it."""

    def __init__(
        self, engine: Engine, store: Store, *, clients: Sequence[Link], vehicles: Sequence[Link]
    ) -> None:
        self._sides = [(link, LinkSide.VEHICLES) for link in vehicles]
        self._sides += [(link, LinkSide.CLIENTS) for link in clients]
        self._links = {link.name: link for link, _ in self._sides}
        self._streams = [link for link, _ in self._sides if isinstance(link, StreamLink)]
        self._store = store
        self._store_fd = store.fileno()
        self._pump = Pump(engine, store, self._send)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._over: asyncio.Future[int] | None = None
        self._wall_offset: float | None = None

    async def run(self) -> int:
        """Serve until SIGINT or SIGTERM; gives the exit code."""
        self._loop = asyncio.get_running_loop()
        self._over = self._loop.create_future()
        for number in (signal.SIGINT, signal.SIGTERM):
            self._loop.add_signal_handler(number, self._on_signal)
        try:
            for link, side in self._sides:
                self._guarded(link_changed(link, side))
                self._loop.add_reader(link.fileno(), self._on_readable, link)
            if self._store_fd is not None:
                self._loop.add_reader(self._store_fd, self._on_stored)
            if self._streams:
                self._tend(self._loop)
            return await self._over
        finally:
            if self._store_fd is not None:
                self._loop.remove_reader(self._store_fd)
            for link, _ in self._sides:
                self._loop.remove_reader(link.fileno())
                link.close()
            self._close_store()

    def _on_readable(self, link: Link) -> None:
        if not isinstance(link, StreamLink):
            self._take_in(link, link.receive(DRAIN))
            return
        while before := link.take_changes():  # to tell of some may show others
            self._note(link, before)
        pieces = link.receive(DRAIN)
        changes = link.take_changes()
        self._note(link, [change for change in changes if change.state is PeerState.UP])
        self._take_in(link, pieces)
        self._note(link, [change for change in changes if change.state is not PeerState.UP])

    def _take_in(self, link: Link, datagrams: list[tuple[Peer, bytes]]) -> None:
        """Take in what came, but let no setpoint wait for all of it."""
        assert self._loop is not None
        assert self._over is not None
        while datagrams and not self._over.done():
            due = self._timer.when() if self._timer is not None else inf
            left = due - self._loop.time()
            count = max(AT_A_TIME, int(min(left / EACH_TAKES, DRAIN)))
            self._guarded(Packets(link.name, datagrams[:count]))
            datagrams = datagrams[count:]
            if datagrams and self._timer is not None and self._timer.when() <= self._loop.time():
                self._guarded(None)

    def _note(self, link: StreamLink, changes: list[PeerChange]) -> None:
        for change in changes:
            if change.words:
                is_lost = change.state is PeerState.DOWN
                level = logging.WARNING if is_lost else logging.INFO
                log.log(level, "link %s %s", link.name, change.words)
            self._guarded(peer_changed(link, change))

    def _tend(self, loop: asyncio.AbstractEventLoop) -> None:
        if self._over is None or self._over.done():
            return
        loop.call_later(TEND_PERIOD, self._tend, loop)
        for link in self._streams:
            link.tend()
            self._note(link, link.take_changes())

    def _on_stored(self) -> None:
        self._guarded(None)

    def _on_timer(self) -> None:
        self._timer = None
        self._guarded(None)

    def _close_store(self) -> None:
        """What it says to the last goes to the log: there is nobody else to tell."""
        self._store.close()
        for outcome in self._store.take_outcomes():
            if isinstance(outcome, NotKept):
                log.error("%s", outcome.text)

    def _on_signal(self) -> None:
        assert self._loop is not None
        for number in (signal.SIGINT, signal.SIGTERM):  # a second one is not waited for
            self._loop.add_signal_handler(number, self._leave_at_once)
        self._guarded(Shutdown())

    def _leave_at_once(self) -> None:
        self._pump.send_last_words()
        self._finish(0)

    def _guarded(self, item: Input | None) -> None:
        """One turn of the pump, for an input or (None) for the time.

        If the engine fails, stop the vehicles and end: no zombie. What comes after that, or after
        an end at once, is not taken in: a setpoint must not follow the last words.
        """
        if self._over is not None and self._over.done():
            return
        try:
            self._turn(item)
        except Exception:  # whatever our own mistake is, a vehicle must not drive on for it
            log.critical("internal error: stopping every vehicle and ending", exc_info=True)
            self._pump.send_last_words()
            self._finish(EXIT_FAILED)

    def _turn(self, item: Input | None) -> None:
        assert self._loop is not None
        now = self._loop.time()
        offset = time.time() - now
        if self._wall_offset is None or abs(offset - self._wall_offset) > WALL_STEP:
            self._wall_offset = offset
            self._pump.handle(WallClock(offset), now=now)
        if item is None:
            self._pump.handle_deadline(now=now)
        else:
            self._pump.handle(item, now=now)
        self._pump.turn(now=now)
        if self._pump.is_over:
            self._finish(0)
            return
        self._rearm(self._loop)

    def _rearm(self, loop: asyncio.AbstractEventLoop) -> None:
        """Have the timer come in time, or too early: then it is for nothing, and set again.

        Most deadlines only move on, with each packet. To set the timer anew each time costs more.
        """
        due = self._pump.engine.next_deadline()
        if due is None or (self._timer is not None and self._timer.when() <= due):
            return
        if self._timer is not None:
            self._timer.cancel()
        self._timer = loop.call_at(due, self._on_timer)

    def _finish(self, code: int) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._over is not None and not self._over.done():
            self._over.set_result(code)

    def _send(self, outgoing: Outgoing) -> None:
        link = self._links[outgoing.link]
        if outgoing.is_first and isinstance(link, StreamLink):
            link.send(outgoing.peer, outgoing.data, first=True)
        else:
            link.send(outgoing.peer, outgoing.data)
