"""Carries datagrams between the gateways of a fleet through their database (LISTEN and NOTIFY).

A thread with one session listens and sends: libpq takes notifications also while a statement is
executed, and a gateway costs the server one connection. The session is never in a transaction
longer than one statement, because it would keep PostgreSQL from emptying its queue of
notifications. It does not wait for the disk (``synchronous_commit``): a notification does not
outlive a crash anyway. PostgreSQL 18 would not wait either, as nothing else is written.

Each gateway has a channel of its own, and all have one in common. PostgreSQL notifies within a
database only, so fleets in two databases never meet. ``mav_tasks.fleet.exchange`` has the rules.
"""

import secrets
import select
from contextlib import closing
from math import inf
from threading import Thread

from mav_tasks.basics.clock import boot_time
from mav_tasks.fleet.exchange import Arrived, Counts, Exchange
from mav_tasks.fleet.io.inbox import Inbox
from mav_tasks.fleet.io.keeper import Trouble
from mav_tasks.fleet.io.shared_outbox import SharedOutbox
from mav_tasks.fleet.notification import LONGEST, SESSION, Seal
from mav_tasks.fleet.outbox import ALL, KEPT, Pressing, Waiting
from mav_tasks.store.postgres.address import Address
from mav_tasks.store.postgres.failures import PostgresError, failure
from mav_tasks.store.postgres.session import Limits, Session
from mav_tasks.store.postgres.writable import check_writable

OF_USE = 0.5  # s for which an ordinary datagram is of use
GAP = 0.01  # s from one sending of ordinary datagrams to the next: those between go together
RETRY = 0.2  # s from a failure to connect to the next attempt
CLOSE_LIMIT = 0.5  # s for what still waits, at the end
LIMITS = Limits(answer=1.0, statement=1.0, lock=1.0, in_transaction=1.0, sending=1.0)

_NOTIFY = (
    "SELECT count(pg_notify(channel, payload))"
    " FROM unnest(?::text[], ?::text[]) AS notification (channel, payload)"
)


class Carrier:
    """A gateway's mail. Nothing here waits for the database; ``take`` has what has come.

    While the database cannot be used, datagrams wait until they are too old; those that are first
    until it can be used.
    """

    def __init__(self, address: Address, name: str) -> None:
        """Begin, as the gateway of this name, in a database that has the tables of a fleet.

        ``name``: one that ``Keeper`` has taken.
        """
        self._address = address
        self._name = name
        self._outbox = SharedOutbox()
        self._exchange = Exchange(name, self._outbox)
        self._inbox = Inbox()
        self._peers: frozenset[str] = frozenset()
        self._is_troubled = False
        self._is_ending = False
        self._sent_at = 0.0
        self._thread = Thread(target=self._run, name="carrier", daemon=True)
        self._thread.start()

    def __repr__(self) -> str:
        return f"Carrier({self._exchange})"

    @property
    def peers(self) -> frozenset[str]:
        """The gateways that were heard in the last seconds."""
        return self._peers

    @property
    def counts(self) -> Counts:
        """What has come of datagrams and notifications so far."""
        it, outbox, inbox = self._exchange, self._outbox, self._inbox
        return Counts(
            it.sent,
            outbox.dropped,
            outbox.expired,
            it.arrived,
            it.late + inbox.late,
            inbox.unread,
            it.lost,
            it.refused,
        )

    def send(self, to: str, payload: bytes, *, first: bool = False) -> None:
        """Send a datagram (up to 400 bytes) to the gateway of a name; "": to all others.

        It leaves in the order of ``send``, but before all others if it is ``first``, and within
        0.5 s or not at all, 1 s if it is first. Those that are first are sent again after a lost
        connection, and may arrive twice; without a connection they wait until there is one. Once
        they have left they are delivered, however late; ``waited`` tells. Others must also arrive
        in that time.
        """
        if len(payload) > LONGEST:
            raise ValueError(f"a datagram of {len(payload)} bytes: it has up to {LONGEST}")
        now = boot_time()
        self._outbox.put(to, Waiting(payload, now, now + (KEPT if first else OF_USE), first))

    def take(self, most: float = inf) -> list[Arrived | Trouble]:
        """Return up to ``most`` of what has arrived, in its order, and troubles.

        Datagrams that are first come before all others. Raise an exception of the thread.
        """
        return self._inbox.take(most, now=boot_time())

    def fileno(self) -> int | None:
        """Return the descriptor that is readable while ``take`` has something; None: closed."""
        return self._inbox.fileno()

    def close(self) -> None:
        """Send what waits, and end; a database that does not answer is not waited for."""
        self._is_ending = True
        self._outbox.ring()
        self._thread.join(CLOSE_LIMIT)
        self._inbox.close()

    def _run(self) -> None:
        try:
            with closing(self._outbox):
                while not self._is_ending:
                    try:
                        self._connect_and_serve()
                    except PostgresError as error:
                        self._tell(failure(error), error)
                        self._peers = frozenset()
                        self._pause()
        except BaseException as mistake:  # noqa: BLE001  the loop raises it
            self._inbox.put_mistake(mistake)

    def _tell(self, words: str | None, error: PostgresError) -> None:
        if words is None:
            raise error
        if not self._is_troubled and not self._is_ending:
            self._is_troubled = True
            self._inbox.put(Trouble(words))

    def _pause(self) -> None:
        """Wait until the next attempt, unless it is the end."""
        again = boot_time() + RETRY
        while not self._is_ending and (left := again - boot_time()) > 0:
            select.select([self._outbox.fileno()], [], [], left)
            self._outbox.quiet()

    def _connect_and_serve(self) -> None:
        session = Session(self._address, purpose=f"gateway {self._name} mail", limits=LIMITS)
        with closing(session):
            check_writable(session)
            self._listen(session)
            self._send(session, boot_time())  # HELLO: it fails if the queue is full
            if self._is_troubled:
                self._is_troubled = False
                self._inbox.put(Trouble(None))
            poll = select.poll()
            poll.register(session.fileno(), select.POLLIN)
            poll.register(self._outbox.fileno(), select.POLLIN)
            while not self._is_ending:
                self._turn(session, poll)
            self._send(session, boot_time())

    def _listen(self, session: Session) -> None:
        """Listen to both channels, and say so to all."""
        query = "SELECT secret, fleet FROM gateway_secret, meta"
        ((secret, fleet),) = session.execute(query).fetchall()
        session.execute("SELECT set_config('synchronous_commit', 'off', false)")
        # A full queue stays full: PostgreSQL removes what all have read only after a notification
        # that has succeeded, and in this function.
        session.execute("SELECT pg_notification_queue_usage()")
        seal = Seal(secret.encode(), fleet)
        for channel in (seal.channel(self._name), seal.channel(ALL)):  # a hash in hexadecimal
            session.execute(f"LISTEN {channel}")
        self._exchange.begin(seal, secrets.token_bytes(SESSION), now=boot_time())

    def _turn(self, session: Session, poll: select.poll) -> None:
        """Read what has come, send what is due, and wait for what comes next."""
        self._receive(session)
        now = boot_time()
        if now >= self._next_sending(now):
            self._send(session, now)
            return
        poll.poll(max(0.0, (self._next_sending(now) - now) * 1000))
        self._outbox.quiet()

    def _next_sending(self, now: float) -> float:
        match self._outbox.pressing():
            case Pressing.NOW:
                return now
            case Pressing.SOON:
                return min(self._sent_at + GAP, self._exchange.next_deadline())
            case Pressing.NOT:
                return self._exchange.next_deadline()

    def _send(self, session: Session, now: float) -> None:
        self._sent_at = now
        found = self._exchange.notifications(now)
        if found:
            channels, texts = zip(*found, strict=True)
            session.execute(_NOTIFY, (f"{{{','.join(channels)}}}", f"{{{','.join(texts)}}}"))

    def _receive(self, session: Session) -> None:
        for _, text in session.notifications():
            for each in self._exchange.receive(text, now=boot_time()):
                self._inbox.put(each)
        self._peers = self._exchange.peers
