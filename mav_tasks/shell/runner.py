"""The I/O shell: one loop, one timer, one pump; signals and orderly shutdown. It decides nothing.

The engine's time is ``boot_time``, which goes on while the machine is suspended. The loop's time
does not, so the timer is set to the remaining time. The loop wakes at least every TEND_PERIOD: if
two callbacks are further apart than STOOD_STILL, this process or the machine has stalled.
"""

import asyncio
import logging
import os
import signal
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from math import inf
from typing import Protocol, cast

from mav_tasks.basics.clock import boot_time
from mav_tasks.config.settings import Settings
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import (
    FLEET_LINK,
    AtOnce,
    Congestion,
    HaltNotStored,
    Input,
    KeysChanged,
    LinkChanged,
    LinkSide,
    Outgoing,
    PeerChanged,
    SettingsChanged,
    Shutdown,
    StoreFailed,
    WallClock,
)
from mav_tasks.engine.snapshot import Reach
from mav_tasks.links.base import (
    TEND_PERIOD,
    Link,
    ListeningLink,
    PacedLink,
    PeerChange,
    PeerState,
    StreamLink,
)
from mav_tasks.links.policy import LinkPolicy
from mav_tasks.mavlink.signing import Key
from mav_tasks.mavlink.stream import has_packet
from mav_tasks.recording.observer import EngineObserver
from mav_tasks.shell.link_reader import DRAIN, LinkReader
from mav_tasks.shell.pump import Pump
from mav_tasks.store import Evicted, Store

log = logging.getLogger("mav_tasks")

EACH_TAKES = 1e-4  # s to handle one datagram: the first estimate for each link
LEARNT = 0.2  # weight of the latest sample in the moving average: one may be slow by chance
SLOWER = 4.0  # a slow sample counts as at most this multiple of the estimate
TURN = 1e-3  # s, for which datagrams are handled even if a setpoint is due
STOOD_STILL = 0.3  # s between two callbacks: a stall; older telemetry must not steer
WALL_STEP = 0.5  # s, a change of the wall clock's offset that is reported

HANGUP = 0.2  # s after SIGHUP, when the runner checks whether the terminal is gone

EXIT_FAILED = 70  # EX_SOFTWARE: the engine itself failed
EVICTED = -1  # no exit code: the fleet has ended this gateway's lease, and serving begins again
HEAR = 0.1  # s between two reports to the fleet of the vehicles that are heard


#: the default of a link without a policy
TAKES_ALL = LinkPolicy()


def link_changed(link: Link, side: LinkSide, policy: LinkPolicy = TAKES_ALL) -> LinkChanged:
    """Return the engine input for a link that is up."""
    return LinkChanged(
        link.name,
        side,
        up=True,
        peers=link.peers,
        is_local=link.is_local,
        is_stream=link.is_stream,
        takes_unsigned=policy.takes_unsigned,
        key=policy.key,
        capacity=link.capacity if isinstance(link, PacedLink) else None,
    )


def peer_changed(link: Link, change: PeerChange) -> PeerChanged | Congestion | None:
    """Return the engine input for a change of a peer; None if the engine knows it."""
    match change.state:
        case PeerState.UP | PeerState.DOWN as state:
            return PeerChanged(link.name, change.peer, up=state is PeerState.UP)
        case PeerState.HEARD | PeerState.REFUSED:
            return None
        case state:
            return Congestion(link.name, change.peer, is_congested=state is PeerState.CONGESTED)


class Reload(Protocol):
    """The interface of ``config.reload``: reads the settings again."""

    @property
    def was_asked(self) -> bool:
        """Whether SIGHUP came before the runner ran."""

    def begin(self, put: Callable[[Settings], Mapping[str, float]]) -> None:
        """Read the settings in the background, then call ``put``.

        ``put`` returns the parameters that clients have set.
        """


class Keys(Protocol):
    """The interface of the key ring: the keys, and their changes."""

    @property
    def keys(self) -> tuple[Key, ...] | None:
        """The keys in force; None if there is no key ring."""

    def begin(self, put: Callable[[tuple[Key, ...]], None]) -> None:
        """Call ``put`` in the loop after each change from now on."""

    def close(self) -> None:
        """Stop reporting changes."""


class Lease(Protocol):
    """The interface of ``gateway``: the lease of a gateway of a fleet."""

    #: whether the fleet has ended it: another gateway may have the vehicles
    is_over: bool

    def fileno(self) -> int | None:
        """Return the descriptor that is readable while ``take`` has something."""

    def take(self) -> Iterable[Input]:
        """Return what has changed."""
        ...

    def hear(self, reach: Reach) -> None:
        """Take which vehicles are heard, and which the engine has."""

    def expect(self, tasks: frozenset[int]) -> None:
        """Take ``Engine.expected``; another object means that the answers must come again."""


class Runner:
    """Runs an engine on real links until a signal ends it."""

    def __init__(
        self,
        engine: Engine,
        store: Store,
        *,
        clients: Sequence[Link],
        vehicles: Sequence[Link],
        reload: Reload,
        keys: Keys,
        observers: Sequence[EngineObserver] = (),
        policies: Mapping[str, LinkPolicy] | None = None,
        lease: Lease | None = None,
        clock: Callable[[], float] = boot_time,
    ) -> None:
        """``policies``: by link name. A link without a policy accepts unsigned packets.

        ``lease``: of a gateway of a fleet; None: all vehicles are this server's.
        """
        self._lease = lease
        self._clock = clock
        self._reload = reload
        self._policies = policies or {}
        self._keys = keys
        self._terminals = [fd for fd in range(3) if os.isatty(fd)]
        self._sides = [(link, LinkSide.VEHICLES) for link in vehicles]
        self._sides += [(link, LinkSide.CLIENTS) for link in clients]
        self._links = {link.name: link for link, _ in self._sides}
        self._streams = [link for link, _ in self._sides if isinstance(link, StreamLink)]
        #: links that send some packets before others
        self._hurries = {*(link.name for link in self._streams), FLEET_LINK}
        self._store = store
        self._store_fd = store.fileno()
        self._pump = Pump(engine, store, self._send, observers=observers)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._due = inf  # when the timer fires, in the engine's time
        self._reader = LinkReader(self._sides, clock=clock, note=self._note)
        self._ran_at = inf  # when the last callback began
        self._over: asyncio.Future[int] | None = None
        #: s to handle a datagram of a link and send the results: longer with many clients
        self._each_takes = dict.fromkeys(self._links, EACH_TAKES)
        self._wall_offset: float | None = None
        self._is_ending = False

    @property
    def woke_at(self) -> float:
        """When the present callback began, and with it the reading of what it handles."""
        return self._ran_at

    def serve(self, loops: asyncio.Runner) -> int:
        """Serve until SIGINT or SIGTERM; return the exit code, or EVICTED.

        The loop has their handlers before it runs: one that raises there could make it forget the
        task that it was about to start, and the process would never end.
        """
        self._loop = loops.get_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            self._loop.add_signal_handler(number, self._on_signal)
        return loops.run(self._serve(self._loop))

    async def _serve(self, loop: asyncio.AbstractEventLoop) -> int:
        self._over = loop.create_future()
        try:
            if self._keys.keys is not None:
                self._put_keys(self._keys.keys)
            self._keys.begin(self._put_keys)
            for link, side in self._sides:
                policy = self._policies.get(link.name, TAKES_ALL)
                self._guarded(link_changed(link, side, policy))
                if isinstance(link, ListeningLink):
                    is_heard = partial(self._pump.engine.has_heard, link.name)
                    is_signed = not policy.takes_unsigned
                    link.watch(is_heard, has_packet=has_packet, is_signed=is_signed)
            for link, _ in self._sides:
                loop.add_reader(link.fileno(), self._on_readable)
            if self._store_fd is not None:
                loop.add_reader(self._store_fd, self._on_stored)
            if self._lease is not None and (lease_fd := self._lease.fileno()) is not None:
                loop.add_reader(lease_fd, self._on_lease, self._lease)
                self._hear(self._lease, loop)
            self._tend(loop)
            loop.add_signal_handler(signal.SIGHUP, self._on_hangup)
            if self._reload.was_asked:
                self._reload.begin(self._put)
            return await self._over
        finally:
            if self._store_fd is not None:
                loop.remove_reader(self._store_fd)
            if self._lease is not None and (lease_fd := self._lease.fileno()) is not None:
                loop.remove_reader(lease_fd)
            for link, _ in self._sides:
                loop.remove_reader(link.fileno())
                link.close()
            self._reader.close()
            self._keys.close()
            self._close_store()
            self._pump.close()

    def _on_readable(self) -> None:
        """Read all readable links together, so that the order of callbacks does not matter."""
        self._wake()
        clients, vehicles = self._reader.readable()
        if clients:
            self._take_in(clients)
        for link in vehicles:
            self._take_in([link])
        self._reader.note_gone()
        if self._streams:  # they have no stamps
            self._reader.look()

    def _wake(self) -> None:
        """Check whether this process has stalled: if so, handle the backlog first."""
        now, before = self._clock(), self._ran_at
        self._ran_at = now
        if now - before <= STOOD_STILL:
            return
        self._due = inf  # the timer must be set again: the loop's clock stood still while suspended
        packets = self._reader.read_late(before)
        self._guarded(AtOnce(packets) if packets else None)
        self._reader.note_gone()

    def _take_in(self, links: Sequence[Link]) -> None:
        """Handle a share of what these links have, so that no setpoint waits for all of it.

        The rest stays in the kernel until the next turn, which is at once.
        """
        assert self._over is not None
        if self._over.done():
            return
        began = self._clock()
        room = max(self._due - began, TURN) / sum(self._each_takes[link.name] for link in links)
        packets = self._reader.read(links, max(1, int(min(room, DRAIN))))
        if not packets:
            return
        self._guarded(AtOnce(packets) if len(packets) > 1 else packets[0])
        ended = self._clock()
        for each in packets:
            estimate = self._each_takes[each.link]
            took = (ended - began) / sum(len(other.datagrams) for other in packets)
            self._each_takes[each.link] += LEARNT * (min(took, SLOWER * estimate) - estimate)
        if self._due <= ended:
            self._guarded(None)

    def _note(self, link: StreamLink, changes: list[PeerChange]) -> None:
        for change in changes:
            if change.words:
                is_lost = change.state in (PeerState.DOWN, PeerState.REFUSED)
                level = logging.WARNING if is_lost else logging.INFO
                log.log(level, "link %s %s", link.name, change.words)
            item = peer_changed(link, change)
            if item is not None:
                self._guarded(item)

    def _tend(self, loop: asyncio.AbstractEventLoop) -> None:
        if self._over is None or self._over.done():
            return
        loop.call_later(TEND_PERIOD, self._tend, loop)
        self._wake()
        for link in self._streams:
            link.poll()
            self._note(link, link.take_changes())
        self._reader.look()

    def _hear(self, lease: Lease, loop: asyncio.AbstractEventLoop) -> None:
        """Report to the fleet which vehicles are heard, again and again."""
        if self._over is None or self._over.done():
            return
        loop.call_later(HEAR, self._hear, lease, loop)
        lease.hear(self._pump.engine.reach(now=self._clock()))

    def _on_lease(self, lease: Lease) -> None:
        self._wake()
        try:
            news = tuple(lease.take())
        except Exception as mistake:  # noqa: BLE001 - a bug of its thread
            self._fail(mistake)
            return
        for item in news:
            self._guarded(item)
        if lease.is_over:
            self._finish(EVICTED)

    def _on_stored(self) -> None:
        self._wake()
        self._guarded(None)

    def _on_timer(self) -> None:
        self._timer, self._due = None, inf
        self._wake()
        self._guarded(None)

    def _close_store(self) -> None:
        """Close the store; log its last outcomes, as the engine no longer takes them."""
        self._store.close()
        for outcome in self._store.take_outcomes():
            if isinstance(outcome, StoreFailed | HaltNotStored | Evicted):
                log.error("%s", outcome.text)

    def _on_signal(self) -> None:
        assert self._loop is not None
        self._is_ending = True
        for number in (signal.SIGINT, signal.SIGTERM):  # a second signal ends at once
            self._loop.add_signal_handler(number, self._leave_at_once)
        self._guarded(Shutdown())

    def _on_hangup(self) -> None:
        """Read the settings again; if the terminal is gone, shut down instead."""
        assert self._loop is not None
        if self._terminals:  # SIGHUP may come a moment before the terminal is gone
            self._loop.call_later(HANGUP, self._end_or_begin)
        else:
            self._reload.begin(self._put)

    def _end_or_begin(self) -> None:
        if self._is_ending:  # kernel and shell both send SIGHUP when a terminal closes
            return
        if all(map(os.isatty, self._terminals)):
            self._reload.begin(self._put)
        else:
            self._on_signal()

    def _put(self, settings: Settings) -> Mapping[str, float]:
        """Put new settings into force; return the parameters of clients, which override them."""
        before = self._pump.engine.not_in_force
        self._guarded(SettingsChanged(settings))
        for why in self._pump.engine.not_in_force:
            if why not in before:
                log.warning("parameter of an earlier run ignored: %s", why)
        return self._pump.engine.parameters

    def _put_keys(self, keys: tuple[Key, ...]) -> None:
        """Tell the engine which keys are usable: before its first packet, and at each change."""
        self._guarded(KeysChanged(keys))

    def _leave_at_once(self) -> None:
        self._pump.send_last_words()
        self._finish(0)

    def _guarded(self, item: Input | None) -> None:
        """Run one turn of the pump, for an input or (None) for a deadline.

        If the engine raises, stop the vehicles and end: no zombie. Ignore inputs after the end: a
        setpoint must not follow the emergency stop packets.
        """
        if self._over is not None and self._over.done():
            return
        try:
            self._turn(item)
        except Exception as mistake:  # noqa: BLE001 - a bug must not let a vehicle drive on
            self._fail(mistake)

    def _fail(self, mistake: Exception) -> None:
        """Stop the vehicles and end, because of a bug of ours."""
        self._pump.send_last_words()  # first: a traceback reads files, from a slow disk perhaps
        log.critical("internal error: stopping every vehicle and ending", exc_info=mistake)
        self._finish(EXIT_FAILED)

    def _turn(self, item: Input | None) -> None:
        assert self._loop is not None
        now = self._clock()
        offset = time.time() - now
        if self._wall_offset is None or abs(offset - self._wall_offset) > WALL_STEP:
            self._wall_offset = offset
            self._pump.handle(WallClock(offset), now=now)
        if item is None:
            self._pump.handle_deadline(now=now)
        else:
            self._pump.handle(item, now=now)
        self._pump.turn(now=now)
        if self._pump.is_over or self._pump.is_evicted:
            self._finish(EVICTED if self._pump.is_evicted else 0)
            return
        if self._lease is not None:
            self._lease.expect(self._pump.engine.expected)
        self._rearm(self._loop)

    def _rearm(self, loop: asyncio.AbstractEventLoop) -> None:
        """Move the timer forward if the next deadline is earlier; never move it back.

        Most packets move a deadline back. A timer that fires too early costs less than setting it
        after each packet.
        """
        due = self._pump.engine.next_deadline()
        if due is None or self._due <= due:
            return
        if self._timer is not None:
            self._timer.cancel()
        self._due = due
        self._timer = loop.call_later(max(0.0, due - self._clock()), self._on_timer)

    def _finish(self, code: int) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._over is not None and not self._over.done():
            self._over.set_result(code)

    def _send(self, outgoing: Outgoing) -> None:
        if outgoing.until < inf and self._is_over_for(outgoing):
            return
        link = self._links[outgoing.link]
        if outgoing.is_first and outgoing.link in self._hurries:
            cast(StreamLink, link).send(outgoing.peer, outgoing.data, first=True)
        else:
            link.send(outgoing.peer, outgoing.data)

    def _is_over_for(self, outgoing: Outgoing) -> bool:
        """Whether a packet is too old to send, because this process stalled after making it."""
        return self._clock() > outgoing.until
