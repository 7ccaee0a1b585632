"""The thread that asks the database, so that nobody else ever waits for it.

A look-up of the host's name, a connection or an answer may take as long as they like.
"""

from dataclasses import dataclass
from queue import SimpleQueue
from threading import Thread

from mav_tasks.basics.mailbox import Mailbox
from mav_tasks.fleet.io.lease_database import Answer, LeaseDatabase
from mav_tasks.fleet.member import Request
from mav_tasks.store.postgres.failures import PostgresError, failure


@dataclass(frozen=True, slots=True)
class Connected:
    """A new session has begun."""


@dataclass(frozen=True, slots=True)
class Lost:
    """The session is over, or none could be begun; ``words`` say why."""

    words: str


Result = Connected | Answer | Lost


class Asker:
    """Does one job at a time, and puts the result of each into a mailbox."""

    def __init__(self, database: LeaseDatabase, mail: Mailbox[Result]) -> None:
        self._database = database
        self._mail = mail
        self._jobs: SimpleQueue[Request | Connected | None] = SimpleQueue()
        self._thread = Thread(target=self._run, name="lease database", daemon=True)
        self._thread.start()

    def __repr__(self) -> str:
        return f"Asker({self._database!r})"

    def connect(self) -> None:
        """Begin a new session; the result is Connected or Lost."""
        self._jobs.put(Connected())

    def ask(self, request: Request) -> None:
        """Carry out a request; the result is an Answer or Lost."""
        self._jobs.put(request)

    def close(self, *, within: float) -> None:
        """End the session after the present job; wait for that, but not longer than ``within``."""
        self._jobs.put(None)
        self._thread.join(within)

    def _run(self) -> None:
        try:
            while (job := self._jobs.get()) is not None:
                self._mail.put(self._result(job))
        except BaseException as mistake:  # noqa: BLE001  the keeper raises it
            self._mail.put_mistake(mistake)
        finally:
            self._database.close()

    def _result(self, job: Request | Connected) -> Result:
        try:
            if not isinstance(job, Connected):
                return self._database.execute(job)
            self._database.connect()
            return job
        except PostgresError as error:
            words = failure(error)
            if words is None:
                raise
            return Lost(words)
