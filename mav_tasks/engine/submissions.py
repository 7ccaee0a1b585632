"""Submissions of tasks: recognised if they come again, queued, and acknowledged once durable."""

from functools import partial

from mav_tasks.engine import translate
from mav_tasks.engine.asked import Asked
from mav_tasks.engine.commit_gate import CommitGate
from mav_tasks.engine.gcs_side import GcsSide
from mav_tasks.errors import Rejection
from mav_tasks.mavlink.enums import MavResult, MavSeverity
from mav_tasks.services.command_receiver import NonceReused, Repeat
from mav_tasks.settings import Settings
from mav_tasks.tasks.book import TaskBook
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import Task, describe

R = TaskReason


class Submissions:
    """What becomes a task, and whether it may be said so yet."""

    def __init__(self, gcs: GcsSide, book: TaskBook, settings: Settings) -> None:
        self._gcs = gcs
        self._book = book
        self._settings = settings
        self._gate = CommitGate()
        self._store_is_away = False
        self._is_closing = False

    def close(self) -> None:
        """Take no more: the server ends."""
        self._is_closing = True

    def apply(self, settings: Settings) -> None:
        """Take new settings."""
        self._settings = settings

    def committed(self, through: int, *, now: float) -> None:
        """Let go what waited for the store."""
        self._store_is_away = False
        self._gate.committed(through, now=now)

    def store_failed(self) -> None:
        """Refuse new submissions until something has been committed again."""
        self._store_is_away = True

    def next_deadline(self) -> float | None:
        """Give when a submission has waited too long for the store."""
        return self._gate.next_deadline()

    def handle_deadline(self, *, now: float) -> None:
        """Withdraw submissions that did not become durable in time."""
        self._gate.handle_deadline(now=now)

    def submit(self, asked: Asked, *, now: float) -> None:
        """Queue the task that a command asks for; Rejection says why not."""
        command = asked.command
        asked.client.uses_dialect = True
        nonce = translate.nonce_of(command)
        try:
            repeat = asked.receiver.same_submission(command, nonce=nonce, now=now)
        except NonceReused:
            raise Rejection(R.NONCE_REUSED, f"nonce {nonce} was used for something else") from None
        if repeat is not None:
            self._answer_repeat(asked, repeat, now=now)
            return
        if self._is_closing:
            raise Rejection(R.RATE_LIMITED, "the server is shutting down")
        draft = translate.draft_of(
            command,
            asked.vehicle.system_id,
            asked.client.submitter(asked.packet.source),
            self._settings.driving,
        )
        if self._store_is_away:
            raise Rejection(R.STORE_UNAVAILABLE, "the store is away: not accepted")
        task = asked.vehicle.tasks.submit(draft, now=now)
        asked.receiver.remember_submission(asked.pending, nonce=nonce)
        self._gate.hold(
            self._book.recorded,
            give_up_at=now + self._settings.watch.commit,
            release=partial(self._accept, asked, task),
            give_up=partial(self._withdraw, asked, task),
        )

    def _accept(self, asked: Asked, task: Task, *, now: float) -> None:
        """The submission is durable: acknowledge it with the task's id, and tell of it."""
        asked.answer(MavResult.ACCEPTED, task.id)
        asked.client.statuses.changed(task.id)
        words = f"Task {task.id} queued: {describe(task.goal)}"
        self._gcs.tell(words, MavSeverity.INFO, asked.vehicle.server_address, now=now)

    def _withdraw(self, asked: Asked, task: Task, *, now: float) -> None:
        asked.receiver.forget_submission(asked.pending, nonce=task.nonce)
        self._store_is_away = True
        current = self._book.get(task.id)
        if current is not None and asked.vehicle.tasks.position(current) is not None:
            asked.vehicle.tasks.withdraw(current, now=now)
        refusal = Rejection(R.STORE_UNAVAILABLE, "not stored in time: not accepted")
        self._book.record(asked.refuse(refusal, now=now))

    def _answer_repeat(self, asked: Asked, repeat: Repeat, *, now: float) -> None:
        """The same submission again: the same answer, or none yet if it has none yet."""
        answer = repeat.first.answer
        if answer is None:
            return
        asked.answer(MavResult(answer.result), answer.result_param2)
        if repeat.same_payload:
            words = f"same command again: still task {answer.result_param2}"
            asked.tell(words, MavSeverity.INFO, now=now)
