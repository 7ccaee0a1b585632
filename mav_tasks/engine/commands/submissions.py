"""Submissions of tasks: deduplicated, queued, and acknowledged once durable."""

from collections import defaultdict
from collections.abc import Hashable
from functools import partial

from mav_tasks.basics.errors import Rejection
from mav_tasks.config.settings import Settings
from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.clients.rights import OPERATOR, Rights
from mav_tasks.engine.clients.sender import Said
from mav_tasks.engine.commands.ability import check_reach, driven
from mav_tasks.engine.commands.command_request import OF_ONE_TASK, CommandRequest
from mav_tasks.engine.commands.goals import parse_command
from mav_tasks.engine.commands.ordering import (
    AGAIN,
    has_left_before_halt,
    why_older,
)
from mav_tasks.engine.commands.translate import IN_FORCE, result_of
from mav_tasks.engine.commit_gate import CommitGate, DependencyQuestions
from mav_tasks.engine.policy import TASK_COMMANDS
from mav_tasks.engine.timers import Effect, Timers, leave_it
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.kinds import GoTo
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavCmd, MavResult, MavSeverity
from mav_tasks.tasks.deduplicator import Known, SubmissionDeduplicator
from mav_tasks.tasks.forecast import known_when_empty
from mav_tasks.tasks.lifecycle import TAKEN, WAITING, TaskReason, words_of
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import DEFAULT_PRIORITY, Draft, Submitter, Task, TaskId

R = TaskReason

#: texts why a queue is paused, short for a ground station's first words
PAUSED = {
    R.OPERATOR: "queue paused",
    R.STOPPED: "STOP in force",
    R.TAKEOVER: "takeover",
    R.FAILSAFE: "failsafe",
    R.RESTARTED: "after a restart",
}
GIVEN_UP = 3.5  # s, after which a client has stopped waiting for an answer
NONCE = 3  # its index among the parameters


class Submissions:
    """The entry of all new tasks, which are acknowledged once durable."""

    def __init__(
        self,
        gcs: GcsSide,
        registry: TaskRegistry,
        deduplicator: SubmissionDeduplicator,
        questions: DependencyQuestions,
        timers: Timers,
        settings: Settings,
    ) -> None:
        self._gcs = gcs
        self._registry = registry
        self.deduplicator = deduplicator
        #: holds submissions that run after a task of another gateway's vehicle
        self.questions = questions
        #: holds what waits for the store, also for other modules
        self.gate = CommitGate(registry, timers, within=settings.watch.commit)
        #: by task that is not durable yet: requests to answer, one for each client and command
        self._undecided: dict[TaskId, list[CommandRequest]] = {}
        #: by vehicle: requests that have changed something which is not durable yet, in their
        #: order, with why each is refused if it is not in time, and how it is undone
        self._changes: dict[int, dict[CommandRequest, tuple[str, Effect]]] = defaultdict(dict)
        self.store_is_away = False  #: until something is committed: no new submissions
        self._is_closing = False

    def close(self) -> None:
        """Refuse new submissions from now on: the server shuts down."""
        self._is_closing = True

    def apply(self, settings: Settings) -> None:
        self.gate.within = settings.watch.commit

    def submit(self, asked: CommandRequest, *, now: float) -> None:
        """Submit the task of a command. Raise Rejection if it is refused."""
        client, vehicle, command = asked.client, asked.vehicle, asked.command
        if client.waited > GIVEN_UP:
            raise Rejection(R.STALE, "delayed by the server: send it again")
        is_ours, settings = command.command in TASK_COMMANDS, vehicle.parts.settings
        wish, terms, marks = parse_command(
            command,
            asked.packet.raw,
            settings.driving,
            now=now,
            priority=DEFAULT_PRIORITY if is_ours else _priority_of(asked.submitter, settings),
            is_cruising=command.target.component_id in (0, AUTOPILOT),
        )
        # A stock client counts TASK_STATUS, which it cannot read, as a lost packet; it fills unused
        # parameters with zeros. A nonce, or NaN for none, shows that the client knows our dialect.
        client.uses_dialect |= is_ours and command.params[NONCE] != 0.0
        goal, words = driven(wish, vehicle.parts.persona, system_id=vehicle.system_id)
        if isinstance(goal, GoTo):
            check_reach(vehicle, goal)
        draft = Draft(vehicle.system_id, command.command, goal, asked.submitter, terms, marks)
        is_click = not is_ours and asked.is_go_to
        runs_now = is_click and (settings.guided == "now" or self._is_next_word(asked, now=now))
        why_not = why_older(asked, now=now) if runs_now else ""
        known, origin = self.deduplicator.known, vehicle.where.origin
        if before := known(draft, confirmation=command.confirmation, origin=origin, now=now):
            self.answer_repeat(asked, before, now=now)
            return
        if after := draft.terms.after:
            again, refuse = partial(self.submit, asked), partial(self.refuse, asked)
            if self.questions.hold(after, again, refuse, now=now):
                return
        waits = bool(vehicle.tasks.paused)  # then nothing moves before a command to continue
        if has_left_before_halt(asked, anybodys=not waits):
            raise Rejection(R.STALE, f"{vehicle.tasks.halts.words} came later: {AGAIN}")
        task = self.take_in(
            asked.rights,
            vehicle,
            draft,
            runs_now=runs_now,
            why_not=why_not,
            # as on an autopilot; a task command waits until its client has ended driving
            ends_driving_of=None if is_ours else client.key,
            now=now,
        )
        self.await_commit(asked, task, now=now)
        if words:
            asked.tell(words, MavSeverity.INFO, now=now)

    def _is_next_word(self, asked: CommandRequest, *, now: float) -> bool:
        """Return whether an operator's click drives at once, as on an autopilot.

        It does after a halt by the same station, which so gives the vehicle back, and out of a mode
        in which no task starts. A halt of somebody else it does not end.
        """
        vehicle, tasks = asked.vehicle, asked.vehicle.tasks
        if tasks.is_stopped or vehicle.parts.hold_before.holder(now=now):
            return False
        if not asked.rights.reach(OPERATOR):
            return False
        if tasks.paused:
            return tasks.halts.held_by is asked.sender
        return vehicle.joint.state(now=now).is_led and vehicle.armed

    def refuse(
        self,
        asked: CommandRequest,
        refusal: Rejection,
        *,
        now: float,
        result: MavResult | None = None,
    ) -> None:
        """Answer a refused command; record it, and tell the client the words.

        ``result``: None for the result that follows from the reason.
        """
        result = result_of(refusal.reason) if result is None else result
        if asked.client.may_be_refused(now=now):
            self._registry.record(asked.refuse(refusal, result=result, now=now))
        else:  # a flood of refusals fills neither disk nor network
            asked.answer(result, refusal.reason)

    def answer_once_durable(
        self,
        asked: CommandRequest,
        task_id: TaskId,
        words: str,
        *,
        now: float,
        undo: Effect,
        then: Effect = leave_it,
    ) -> None:
        """Accept a request once what it has changed is durable, else undo it; ``words``: why.

        With it all later changes of its vehicle are undone, the last one first: they began with
        what it had changed, and one may be its copy. ``then``: what else is done once accepted.
        """
        changes = self._changes[asked.rover]
        changes[asked] = words, undo

        def accept(*, now: float) -> None:
            if changes.pop(asked, None) is not None:
                asked.answer(MavResult.ACCEPTED, task_id)
                then(now=now)

        def give_up(*, now: float) -> None:
            while asked in changes:
                last, (why, undo_last) = changes.popitem()
                undo_last(now=now)
                self._registry.record(last.refuse(Rejection(R.STORE_UNAVAILABLE, why), now=now))

        self.gate.hold(accept, give_up, now=now)

    def run_now(self, asked: CommandRequest, draft: Draft, *, now: float) -> None:
        """Submit an immediate task. Raise Rejection if it is refused."""
        vehicle = asked.vehicle
        vehicle.joint.end_driving_of(asked.client.key, now=now)
        origin = vehicle.where.origin
        if before := self.deduplicator.known(draft, confirmation=0, origin=origin, now=now):
            self.answer_repeat(asked, before, now=now)
            return
        task = self.take_in(asked.rights, vehicle, draft, runs_now=True, now=now)
        self.await_commit(asked, task, now=now)

    def submit_draft(self, asked: CommandRequest, draft: Draft, *, now: float) -> Task:
        """Submit a task that a command implies. Raise Rejection if it is refused."""
        task = self.take_in(asked.rights, asked.vehicle, draft, now=now)
        self.await_commit(asked, task, now=now)
        return task

    def submit_plan(self, rights: Rights, vehicle: Vehicle, draft: Draft, *, now: float) -> Task:
        """Submit an uploaded plan; the caller acknowledges it. Raise Rejection if it is refused."""
        task = self.take_in(rights, vehicle, draft, now=now)
        self.deduplicator.remember(task, at=now, now=now)
        return task

    def take_in(
        self,
        rights: Rights,
        vehicle: Vehicle,
        draft: Draft,
        *,
        now: float,
        runs_now: bool = False,
        why_not: str = "",
        ends_driving_of: Hashable | None = None,
    ) -> Task:
        """Submit a new task of any origin. Raise Rejection if it is refused.

        ``why_not``: text why it is refused as stale, if all other checks pass; "" if it is not.
        """
        self.check_open()
        if runs_now:
            rights.require(OPERATOR, "run a task immediately")
        waiting = partial(vehicle.tasks.count_of, draft.submitter)
        known = partial(known_when_empty, vehicle.tasks, self._registry, now=now)
        draft = rights.checked(draft, waiting=waiting, known=known)
        if ends_driving_of is not None:
            vehicle.joint.end_driving_of(ends_driving_of, now=now)
        if why_not:
            raise Rejection(R.STALE, why_not)
        if runs_now:
            return vehicle.joint.run_now(draft, actor=str(draft.submitter), now=now)
        return vehicle.tasks.submit(draft, now=now)

    def known_plan(self, draft: Draft, *, begun_at: float, now: float) -> TaskId | None:
        """Return the task of an equal plan uploaded just before, whose ack may be lost, or None.

        This copy's ack may be lost, too, so the time for a further copy starts again.
        """
        known = self.deduplicator.known(draft, confirmation=1, origin=None, now=begun_at)
        task = None if known is None else self._registry.get(known.task_id)
        if task is None:
            return None
        self.deduplicator.remember(task, at=now, now=now)
        return task.id

    def take_back(self, vehicle: Vehicle, task: Task, *, now: float) -> None:
        """Undo a submission that was not stored in time."""
        self.deduplicator.forget(task)
        self.store_is_away = True
        current = self._registry.get(task.id)
        if current is not None and current.state in WAITING:
            vehicle.tasks.room.withdraw(current, now=now)

    def retract(self, task: Task) -> list[CommandRequest]:
        """Forget a submission that the store has refused; return the requests to answer."""
        self.deduplicator.forget(task)
        return self._undecided.pop(task.id, [])

    def held(self, vehicle: Vehicle, submitter: Submitter) -> None:
        """Note that a client halted a vehicle: a return that it requests next is a new task."""
        self.deduplicator.held(submitter, vehicle.system_id)

    @property
    def is_open(self) -> bool:
        """Whether new submissions are accepted."""
        return not (self._is_closing or self.store_is_away)

    def check_open(self) -> None:
        """Raise Rejection while new submissions are refused."""
        if self._is_closing:
            raise Rejection(R.RATE_LIMITED, "the server is shutting down")
        if self.store_is_away:
            raise Rejection(R.STORE_UNAVAILABLE, "the store is unavailable: not accepted")

    def await_commit(self, asked: CommandRequest, task: Task, *, now: float) -> None:
        """Acknowledge a new task once it is durable."""
        self.deduplicator.remember(task, at=now, now=now)
        self._undecided[task.id] = [asked]
        accept = partial(self._accept, asked, task)
        self.gate.hold(accept, partial(self._withdraw, asked, task), now=now)

    def _accept(self, asked: CommandRequest, task: Task, *, now: float) -> None:
        """Acknowledge a durable submission with the task's id, and tell all clients.

        It is a warning to a station that must press a button. A client that reads TASK_STATUS gets
        no text that its own task is queued: the acknowledgement and that message say so.
        """
        if task.id not in self._undecided:
            return  # retracted, and answered
        for each in self._undecided.pop(task.id):
            acknowledge(each, task.id)
        give_back(asked, task.id, now=now)
        tasks, own, reads = asked.vehicle.tasks, asked.client, asked.client.uses_dialect
        is_blocked = tasks.immediate != task.id and bool(tasks.paused or tasks.is_held_ahead)
        knows = reads and not is_blocked and not task.choice
        words = ""
        for client in self._gcs.clients:
            if client is own and knows:
                continue
            words = words or accepted_words(asked, task)
            must_act = is_blocked and client is own and not reads
            severity = MavSeverity.WARNING if must_act else MavSeverity.INFO
            client.tell(words, severity, asked.vehicle.server_address, now=now)

    def _withdraw(self, asked: CommandRequest, task: Task, *, now: float) -> None:
        if task.id not in self._undecided:
            return
        askers = self._undecided.pop(task.id)
        tasks = asked.vehicle.tasks
        was_for_now = tasks.immediate == task.id
        self.take_back(asked.vehicle, task, now=now)
        words = "not stored in time: not accepted"
        if was_for_now and tasks.paused:
            words += "; queue paused"
        refusal = Rejection(R.STORE_UNAVAILABLE, words)
        for each in askers:
            self._registry.record(each.refuse(refusal, now=now))

    def answer_halt(self, client: GcsClient, said: Said, to: Address, *, now: float) -> None:
        """Send the answer to a command that has halted a vehicle once a restart would know that.

        The record of halts knows no tasks: one that was cancelled would come back and drive.
        """
        assert said.answer is not None, "it was decided"
        if said.answer.result not in IN_FORCE or said.is_held:  # the latter: a copy
            return
        said.is_held = True

        def accept(*, now: float) -> None:
            said.is_held = False
            assert said.answer is not None, "what is held has one"
            client.answer(said.answer, to)
            if said.words is not None:
                client.tell_refusal(*said.words, now=now)

        def give_up(*, now: float) -> None:
            answer, said.is_held = said.answer, False
            assert answer is not None, "what is held has one"
            reason = int(R.STORE_UNAVAILABLE)
            said.answer = answer._replace(result=MavResult.FAILED, result_param2=reason)
            client.answer(said.answer, to)
            what = "STOP" if answer.command == MavCmd.TASK_STOP else f"Command {answer.command}"
            words = f"{what} in force but not stored: a server restart loses it. See its log"
            self._gcs.tell(words, MavSeverity.ERROR, answer.source, now=now)

        number, first = said.command.command, said.command.params[0]
        ends_tasks = number in OF_ONE_TASK or (number, first) == (MavCmd.TASK_STOP, 1.0)
        self.gate.hold(accept, give_up, now=now, is_halt=not ends_tasks)

    def answer_repeat(self, asked: CommandRequest, known: Known, *, now: float) -> None:
        """Answer a repeated submission as the first, once that has an answer."""
        if known.task_id in self._undecided:
            askers = self._undecided[known.task_id]
            if asked.answers_to not in {each.answers_to for each in askers}:
                askers.append(asked)
            return
        acknowledge(asked, known.task_id)
        task = self._registry.get(known.task_id)
        # one click in QGroundControl sends a command and an item: not a repeat to be told
        is_other_message = task is not None and task.command != asked.command.command
        if known.repeats and not is_other_message:
            state = "" if task is None else f", {task.state.name.lower()}"
            words = f"repeated {known.repeats}, no new task: see task {known.task_id}{state}"
            asked.tell(words, MavSeverity.INFO, now=now)


def give_back(asked: CommandRequest, task_id: TaskId, *, now: float) -> None:
    """End a takeover, or the pause by a halt of the same client, if nothing else waits for that.

    Call this when a task is durable that drives the vehicle at once, if nothing has halted it since
    it was requested: a refused one must not let other tasks start.
    """
    tasks = asked.vehicle.tasks
    is_next = tasks.immediate == task_id and task_id in tasks.waiting
    is_over = tasks.paused in TAKEN or tasks.halts.held_by is asked.sender
    if is_next and is_over and not tasks.has_others:
        asked.vehicle.joint.go_on(actor=asked.actor, now=now)


def _priority_of(submitter: Submitter, settings: Settings) -> int:
    priorities = settings.clients.priorities
    if not priorities:
        return DEFAULT_PRIORITY
    by_address = priorities.get(submitter.address, DEFAULT_PRIORITY)
    return priorities.get(submitter.place, by_address)


def accepted_words(asked: CommandRequest, task: Task) -> str:
    """Return what becomes of a new task: it starts, is queued, or waits for a button."""
    tasks, goal = asked.vehicle.tasks, task.goal.words
    if tasks.immediate == task.id:
        return f"Task {task.id} starts now: {goal}"
    if paused := tasks.paused:  # somebody else may have paused
        again = ", or set Hold and click again" if asked.is_go_to and not tasks.is_stopped else ""
        why = PAUSED.get(paused, words_of(paused))
        return f"Task {task.id} waits, press Continue{again} ({why}): {goal}"
    if tasks.is_held_ahead:
        held = "a task" if tasks.held is None else f"task {tasks.held.id}"
        return f"Task {task.id} waits, press a Held button: {held} is held. {goal}"
    active = tasks.executor.task_id
    ahead = "" if active is None else f" behind task {active}"
    return f"Task {task.id} queued{ahead}: {goal}{chosen_words(task)}"


def chosen_words(task: Task) -> str:
    """Return why the server chose the task's rover, to end a text; "" if it did not choose."""
    return f". Rover {task.vehicle} chosen: {task.choice}" if task.choice else ""


def acknowledge(asked: CommandRequest, task_id: TaskId) -> None:
    """Acknowledge with the task's id; a client that reads TASK_STATUS gets that, with its nonce."""
    asked.answer(MavResult.ACCEPTED, task_id)
    if asked.client.uses_dialect:
        asked.client.note_change(task_id)
