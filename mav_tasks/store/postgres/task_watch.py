"""The thread that tells a gateway how tasks of other gateways stand that its own tasks wait for.

It looks at the table when it is asked, when a notification comes (``dependencies``), and every few
seconds, because a notification is lost with its connection. It only reads: whatever it tells is
committed, and the end of a task is never undone.
"""

import logging
import select
from collections.abc import Mapping
from contextlib import closing
from threading import Thread

from mav_tasks.basics.clock import boot_time
from mav_tasks.basics.mailbox import Mailbox
from mav_tasks.engine.inputs import TasksElsewhere
from mav_tasks.store.base import Outcome
from mav_tasks.store.postgres.address import Address
from mav_tasks.store.postgres.dependencies import CHANNEL
from mav_tasks.store.postgres.failures import PostgresError, failure
from mav_tasks.store.postgres.session import Session
from mav_tasks.store.postgres.writable import check_writable
from mav_tasks.tasks.lifecycle import TERMINAL, TaskState

log = logging.getLogger("mav_tasks")

PERIOD = 2.0  # s between two looks without a notification
RETRY = 0.25  # s between two attempts to connect

States = dict[int, TaskState | None]


class TaskWatch:
    """Puts ``TasksElsewhere`` into a mailbox. It connects when it is asked for the first time."""

    def __init__(self, address: Address, gateway: str, mail: Mailbox[Outcome]) -> None:
        self._address = address
        self._gateway = gateway
        self._mail = mail
        self._questions: Mailbox[frozenset[int]] = Mailbox()
        fd = self._questions.fileno()
        assert fd is not None, "it is open"
        self._fd = fd
        self._ids: frozenset[int] = frozenset()
        self._told: Mapping[int, TaskState | None] = {}
        self._is_closing = self._is_troubled = False
        self._thread = Thread(target=self._run, name="task watch", daemon=True)
        self._thread.start()

    def __repr__(self) -> str:
        return f"TaskWatch({self._gateway}, {sorted(self._ids)})"

    def ask(self, ids: frozenset[int]) -> None:
        """Tell how these tasks stand, and when they end; forget earlier questions. Never blocks."""
        self._questions.put(ids)

    def close(self, *, within: float) -> None:
        """End the thread after its present attempt."""
        self._is_closing = True
        self._questions.put(frozenset())
        self._thread.join(within)
        if not self._thread.is_alive():
            self._questions.close()

    def _run(self) -> None:
        try:
            while not self._is_closing:
                if not self._ids:
                    self._wait(None)
                    self._take_questions()
                    continue
                try:
                    self._connect_and_look()
                except PostgresError as error:
                    self._note(error)
                    self._take_questions()  # or each wait would end at once
                    self._wait(RETRY)
        except BaseException as mistake:  # noqa: BLE001 - a bug of ours: raised in the loop
            self._mail.put_mistake(mistake)

    def _note(self, error: PostgresError) -> None:
        words = failure(error)
        if words is None:
            raise error
        if not self._is_troubled and not self._is_closing:
            self._is_troubled = True
            log.warning("gateway %s cannot see tasks of other gateways: %s", self._gateway, words)

    def _wait(self, seconds: float | None, *fds: int) -> None:
        poll = select.poll()  # not select(): its numbers end at 1,023
        for fd in (self._fd, *fds):
            poll.register(fd, select.POLLIN)
        poll.poll(None if seconds is None else max(0.0, 1000 * seconds))

    def _take_questions(self) -> bool:
        """Take the latest question; return whether there was one. It is answered in full."""
        questions = self._questions.take()
        if questions:
            self._ids, self._told = questions[-1], {}
        return bool(questions)

    def _connect_and_look(self) -> None:
        session = Session(self._address, purpose=f"gateway {self._gateway} tasks")
        with closing(session):
            check_writable(session)  # a replica lags
            session.execute(f"LISTEN {CHANNEL}")
            look_at = 0.0
            while not self._is_closing:
                # also those that came with the answer to a statement
                is_due = self._take_questions() | bool(session.notifications())
                now = boot_time()
                if is_due or now >= look_at:
                    look_at = now + PERIOD
                    self._look(session)
                else:
                    self._wait(look_at - now, session.fileno())

    def _look(self, session: Session) -> None:
        """Tell what is new: at first how each task stands, later only its end."""
        listed = f"{{{','.join(map(str, sorted(self._ids)))}}}"
        query = "SELECT id, state FROM tasks WHERE id = ANY(?::bigint[])"
        found = dict(session.execute(query, (listed,)).fetchall()) if self._ids else {}
        if self._is_troubled:
            self._is_troubled = False
            log.warning("gateway %s sees tasks of other gateways again", self._gateway)
        states: States = {
            task: TaskState(found[task]) if task in found else None for task in sorted(self._ids)
        }
        news = {
            task: state
            for task, state in states.items()
            if task not in self._told or (_is_over(state) and state is not self._told[task])
        }
        self._told = states
        if news:
            self._mail.put(TasksElsewhere(tuple(news.items())))


def _is_over(state: TaskState | None) -> bool:
    """Return whether a task will not change any more; None: it is not there."""
    return state is None or state in TERMINAL
