"""Keeps a gateway's lease, in a thread of its own, and tells what it permits.

The thread drives ``Member`` with the answers of the database and the pings of the other gateways,
and never waits for either: when the trust in the last renewal ends, it says so in time. Whoever is
about to send a packet to a vehicle asks ``may_move`` or ``may_stop``, from any thread, without
waiting. They judge by the clock at that moment, so that also a process that was suspended sends
nothing too late. That clock goes on while the machine is suspended. What is left is a suspension
between the question and its packet: only a fence at the vehicle itself can be against that.
"""

import re
import selectors
from contextlib import closing, suppress
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from threading import Thread

from mav_tasks.basics.clock import boot_time
from mav_tasks.basics.errors import StoreError
from mav_tasks.basics.mailbox import Mailbox
from mav_tasks.fleet.io.asker import Asker, Connected, Lost, Result
from mav_tasks.fleet.io.lease_database import Answer, LeaseDatabase
from mav_tasks.fleet.io.peers import Peers, Sign
from mav_tasks.fleet.lease import Permit, Terms
from mav_tasks.fleet.member import Change, Member, Request
from mav_tasks.store.postgres.address import Address

PING = 0.1  # s from one ping to the next
RETRY = 0.2  # s from a failure to connect to the next attempt
CLOSE_LIMIT = 0.5  # s for the database's answer at the end

_NAME = re.compile(r"[A-Za-z0-9._-]{1,40}")


@dataclass(frozen=True, slots=True)
class Trouble:
    """The database cannot be used; ``words`` say why. None: it can be used again."""

    words: str | None


@dataclass(frozen=True, slots=True)
class Holders:
    """Which vehicle the other gateways hold: pairs of its system id and the gateway's name."""

    pairs: tuple[tuple[int, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Parameters:
    """The parameters that clients have set, at any gateway: pairs of name and value."""

    pairs: tuple[tuple[str, float], ...] = ()


News = Change | Trouble | Permit | Holders | Parameters


def _both_permits(earlier: News, later: News) -> bool:
    return isinstance(earlier, Permit) and isinstance(later, Permit)


class Keeper:
    """A gateway's lease. ``take`` returns what has changed, once ``fileno`` is readable.

    Each renewal is a new Permit. It begins to hold vehicles after ``hear``.
    """

    def __init__(
        self,
        address: Address,
        name: str,
        *,
        host: str,
        port: int = 0,
        system_id: int = 0,
        terms: Terms | None = None,
    ) -> None:
        """Take the name, and begin. ``host``: the IP address at which others reach this machine.

        ``system_id``: with which this gateway sends, 0: unknown. Raise StoreError if the database
        cannot be used, another process has the name, or a gateway runs with another system id.
        """
        if not _NAME.fullmatch(name):
            raise StoreError(f"gateway {name!r}: a name has up to 40 letters, digits, dots, - or _")
        self._member = Member(name, terms or Terms())
        self._permit = Permit()
        self._holders = Holders()
        self._parameters: Parameters | None = None  # not read yet
        self._heard: tuple[frozenset[int], frozenset[int]] = frozenset(), frozenset()
        self._forgotten: SimpleQueue[frozenset[int]] = SimpleQueue()
        self._selector = selectors.DefaultSelector()
        try:
            self._peers = Peers(self._selector, host, port)
        except (OSError, ValueError, OverflowError) as error:
            self._selector.close()
            raise StoreError(
                f"gateway {name}: UDP port {port} of {host}: {error}:"
                " fleet.address must be an IP address of this machine"
            ) from error
        try:
            database = LeaseDatabase(
                address, name, host=host, port=self._peers.port, system_id=system_id
            )
        except BaseException:
            self._peers.close()
            self._selector.close()
            raise
        self._peers.begin(database.secret)
        self._news: Mailbox[News] = Mailbox(replaces=_both_permits)
        self._results: Mailbox[Result] = Mailbox()
        self._asker = Asker(database, self._results)
        self._asked: tuple[Request, float] | None = None  # and when
        self._is_busy = False  # the asker
        self._is_connected = not database.late
        self._is_troubled = bool(database.late)
        if database.late:
            self._news.put(Trouble(database.late))
        self._connect_at = self._ping_at = 0.0
        self._is_ending = False
        self._thread = Thread(target=self._run, name="lease keeper", daemon=True)
        self._thread.start()

    def __repr__(self) -> str:
        return f"Keeper({self._member.name}, {self._permit})"

    @property
    def epoch(self) -> int:
        """The number of the lease: a fencing token, which only rises over the whole fleet."""
        return self._permit.epoch

    def may_move(self, vehicle: int) -> bool:
        """Return whether a packet that moves this vehicle may leave now."""
        return self._permit.may_move(vehicle, boot_time())

    def may_stop(self, vehicle: int) -> bool:
        """Return whether a packet that stops this vehicle may leave now."""
        return self._permit.may_stop(vehicle, boot_time())

    def hear(self, vehicles: frozenset[int], strays: frozenset[int] = frozenset()) -> None:
        """Take which vehicles are heard on the gateway's own links: it takes those that are free.

        It keeps those that it has, but ``Change.lets_go`` names those of the ``strays``, which are
        not heard, that another gateway hears.
        """
        self._heard = vehicles, strays

    def free(self, vehicles: frozenset[int]) -> None:
        """Free vehicles that the engine has forgotten; one that is heard again comes as ``got``."""
        self._forgotten.put(vehicles)

    def take(self) -> list[News]:
        """Return what has changed, in its order; raise an exception of the thread."""
        return self._news.take()

    def fileno(self) -> int | None:
        """Return the descriptor that is readable while there is news; None once it is closed."""
        return self._news.fileno()

    def close(self) -> None:
        """Leave the fleet. Stop the vehicles before: others may have them at once."""
        self._is_ending = True
        self._thread.join()
        self._news.close()

    def _run(self) -> None:
        fileno = self._results.fileno()
        assert fileno is not None
        self._selector.register(fileno, selectors.EVENT_READ)
        try:
            with closing(self._selector), closing(self._peers):  # open as long as it may drive
                try:
                    while not self._is_ending:
                        self._turn()
                    self._tell(Change(tuple(self._member.lease.left(boot_time()))))
                finally:
                    self._permit = Permit()
                    self._asker.close(within=CLOSE_LIMIT)
                    self._results.close()
        except BaseException as mistake:  # noqa: BLE001  the loop raises it
            self._news.put_mistake(mistake)

    def _turn(self) -> None:
        """Do what is due, wait for what comes or is due next, and take that."""
        now = boot_time()
        heard, self._member.strays = self._heard
        self._member.heard = set(heard)
        with suppress(Empty):
            while True:
                self._member.forgotten(self._forgotten.get_nowait())
        self._tell(Change(tuple(self._member.lease.passed(now))))
        self._talk(now)
        if now >= self._ping_at:
            self._ping_at = now + PING
            self._peers.ask(now)
        self._selector.select(max(0.0, self._next_deadline() - boot_time()))
        now = boot_time()
        lease = self._member.lease
        for seen in self._peers.receive(self._member.name, lease.epoch, now=now):
            if seen.sign is Sign.ANSWERED:
                self._member.peer_answered(seen.name, now=seen.at)
            else:
                self._member.peer_refused(seen.name, now=seen.at)
        for result in self._results.take():
            self._receive(result, now)

    def _next_deadline(self) -> float:
        deadlines = [self._ping_at]
        if (lease := self._member.lease.next_deadline()) is not None:
            deadlines.append(lease)
        if not self._is_busy:
            deadlines.append(self._member.next_turn if self._is_connected else self._connect_at)
        return min(deadlines)

    def _talk(self, now: float) -> None:
        """Hand the asker its next job, if it has none."""
        if self._is_busy:
            return
        if not self._is_connected:
            if now >= self._connect_at:
                self._is_busy = True
                self._asker.connect()
        elif (request := self._member.request(now)) is not None:
            self._is_busy = True
            self._asked = request, now
            self._asker.ask(request)

    def _receive(self, result: Result, now: float) -> None:
        self._is_busy = False
        match result:
            case Connected():
                self._is_connected = True
            case Lost(words):
                # at once after a session: the trust in the last renewal outlasts one lost answer
                self._connect_at = now if self._is_connected else now + RETRY
                self._is_connected, self._asked = False, None
                self._tell(self._member.unanswered(now))
                if not self._is_troubled:
                    self._is_troubled = True
                    self._news.put(Trouble(words))
            case Answer(row, endpoints, parameters):
                assert self._asked is not None
                (request, sent), self._asked = self._asked, None
                self._tell(self._member.answered(request, row, sent=sent, now=now))
                holders = Holders(tuple(sorted(self._member.rivals.holders().items())))
                if holders != self._holders:
                    self._holders = holders
                    self._news.put(holders)
                if parameters is not None:
                    self._take_parameters(Parameters(tuple(parameters.items())))
                self._peers.update(endpoints)
                if self._is_troubled:
                    self._is_troubled = False
                    self._news.put(Trouble(None))

    def _take_parameters(self, parameters: Parameters) -> None:
        if parameters != self._parameters:
            self._parameters = parameters
            self._news.put(parameters)

    def _tell(self, change: Change) -> None:
        """Publish what the lease permits now, and what has changed."""
        before, self._permit = self._permit, self._member.lease.permit()
        if self._permit != before:
            self._news.put(self._permit)
        if change != Change():
            self._news.put(change)
