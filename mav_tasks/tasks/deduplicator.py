"""Recognises repeated submissions: driving twice is worse than refusing.

The rules are those of ``dialects/README.md``, "Duplicate detection". The tasks hold all the data
that the rules need, so that a restart forgets nothing.
"""

from collections.abc import Callable, Container, Iterable
from dataclasses import dataclass, field
from math import hypot
from operator import attrgetter

from mav_tasks.basics.errors import Rejection
from mav_tasks.basics.latest import keep_latest, shorten
from mav_tasks.kinds import GlobalPlace, GoTo
from mav_tasks.tasks.driving.frames import local_place
from mav_tasks.tasks.lifecycle import TERMINAL, TaskReason
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import ANY, Draft, Submitter, Task, TaskId

SAME_PACKET = 5.0  # s, the identical packet again (rule 1)
CONFIRMED = 10.0  # s, confirmation > 0 with equal parameters (rule 3)
SAME_GOAL = 5.0  # s, equal absolute goals (rule 4)
NEAR = 1.0  # m; places this close are the same (rule 4)
SAME_PAYLOAD = 2.5  # s since the last copy, without a nonce (rule 5)
#: s after its task's end for which a nonce means that task. Copies come within half a minute of the
#: first (a client repeats for 10 s, a network delays by 20 s), plus the time of a server restart; a
#: person without an answer tries again within minutes
NONCE_KEPT = 600.0
LONGEST = max(SAME_PACKET, CONFIRMED, SAME_GOAL, SAME_PAYLOAD)
RECENT = 1_000  # marks of one client; its packets are remembered, too, but not after a restart
SPARE = 1_000  # nonces; those of forgotten tasks are removed only beyond this
MANY_CLIENTS = 256  # remembered; beyond this, those with the oldest submissions are forgotten


@dataclass(frozen=True, slots=True)
class Known:
    """The task that a submission repeats.

    ``repeats``: what it repeats by a rule that may be mistaken, if the client was not told yet.
    """

    task_id: TaskId
    repeats: str = field(default="", compare=False)


@dataclass(slots=True)
class _Last:
    """A client's last submission of a kind."""

    task_id: TaskId
    draft: Draft
    at: float  # of the last copy
    is_told: bool = False

    def repeated(self, what: str) -> Known:
        """Return what a repeat of it is, and note that its client is told."""
        was_told, self.is_told = self.is_told, True
        return Known(self.task_id, "" if was_told else what)


#: under which a submission is remembered: a packet, or the vehicle (or ANY) that was to go to a
#: place, or that vehicle and a command
_Mark = str | int | tuple[int, int]
#: whose a nonce is: not its endpoint's, for a client may come back from another one
_client: Callable[[Submitter], tuple[str, int, int]] = attrgetter(
    "fingerprint", "system_id", "component_id"
)


class SubmissionDeduplicator:
    """Recent submissions of each client, and the nonces of unfinished and recent tasks."""

    def __init__(self, registry: TaskRegistry) -> None:
        self._registry = registry
        self._clients: dict[Submitter, dict[_Mark, _Last]] = {}
        self._nonces: dict[tuple[tuple[str, int, int], int], TaskId] = {}

    def restore(self, tasks: Iterable[Task], *, now: float) -> None:
        """Load the tasks of an earlier run, oldest first: all nonces, and recent submissions."""
        for task in tasks:
            if not task.is_made:  # nobody submitted that
                # later than now: the clock was set back since, or was another gateway's
                self.remember(task, at=min(task.submitted_at, now), now=now)

    def known(
        self, draft: Draft, *, confirmation: int, origin: GlobalPlace | None, now: float
    ) -> Known | None:
        """Return the task that a submission repeats, or None if it is new.

        A draft for any vehicle has ANY for its vehicle.
        ``origin`` is the vehicle's, to compare places in different frames. Raise
        Rejection(NONCE_REUSED) if the nonce was used for something else.
        """
        if draft.marks.nonce:
            nonce = _client(draft.submitter), draft.marks.nonce
            task = self._registry.get(self._nonces.get(nonce, 0))
            # that of a task that is long over may be used for a new submission
            if task is None or (task.state in TERMINAL and now - task.ended_at > NONCE_KEPT):
                self._nonces.pop(nonce, None)
                return None
            if task.marks.payload != draft.marks.payload:
                raise reused(draft.marks.nonce)
            return Known(task.id)
        client = self._clients.get(draft.submitter, {})
        same = client.get(draft.marks.packet)
        if same is not None and now - same.at <= SAME_PACKET:
            return Known(same.task_id)
        last = client.get((draft.vehicle, draft.command))
        if last is not None and last.draft.marks.payload == draft.marks.payload:
            if confirmation > 0 and now - last.at <= CONFIRMED:
                return Known(last.task_id)
            if now - last.at <= SAME_PAYLOAD:
                last.at = now
                return last.repeated("command")
        goal = client.get(draft.vehicle)
        if (
            goal is not None
            and now - goal.at <= SAME_GOAL
            and _same_place(goal.draft, draft, origin)
        ):
            # copies of this command may follow
            copy = _Last(goal.task_id, draft, now, is_told=True)
            keep_latest(client, (draft.vehicle, draft.command), copy, most=RECENT)
            return goal.repeated("goal")
        return None

    def remember(self, task: Task, *, at: float, now: float) -> None:
        """Remember a submission that became a task."""
        submitter, marks = task.submitter, task.marks
        if marks.nonce:
            self._nonces[_client(submitter), marks.nonce] = task.id
            if len(self._nonces) > SPARE:
                self._forget_nonces()
        is_place = isinstance(task.goal, GoTo)
        if now - at > LONGEST or (marks.nonce and not is_place):
            return  # its nonce alone identifies it
        client = self._clients.get(submitter, {})
        keep_latest(self._clients, submitter, client, most=MANY_CLIENTS)
        vehicle = ANY if task.choice else task.vehicle  # as its submitter named it
        draft = Draft(vehicle, task.command, task.goal, submitter, task.terms, marks)
        last = _Last(task.id, draft, at)
        place = vehicle if is_place else ""
        found = (place,) if marks.nonce else (place, (vehicle, task.command), marks.packet)
        for mark in found:
            if mark != "":
                client.pop(mark, None)  # it is the newest now
                client[mark] = last
        if len(client) > RECENT:
            shorten(client, RECENT)

    def held(self, submitter: Submitter, vehicle: int) -> None:
        """Forget a client's last return after its halt: the next return is new (rule 4).

        A go-to is not forgotten: other messages for the same go-to may still be on their way.
        """
        client = self._clients.get(submitter, {})
        goal = client.get(vehicle)
        if goal is not None and goal.draft.goal == GoTo(None):
            del client[vehicle]

    def forget(self, task: Task) -> None:
        """Forget a submission that was refused after all, so that the client may try it again."""
        if task.marks.nonce:
            self._nonces.pop((_client(task.submitter), task.marks.nonce), None)
        client = self._clients.get(task.submitter, {})
        for mark in [mark for mark, each in client.items() if each.task_id == task.id]:
            del client[mark]

    def forget_vehicle(self, vehicle: int, tasks: Container[TaskId]) -> None:
        """Forget a vehicle with its ``tasks``: the next gateway that has it knows them."""
        self._nonces = {key: each for key, each in self._nonces.items() if each not in tasks}
        for submitter, client in self._clients.items():
            self._clients[submitter] = {
                mark: each
                for mark, each in client.items()
                if each.draft.vehicle != vehicle and each.task_id not in tasks
            }

    def _forget_nonces(self) -> None:
        if len(self._nonces) > 2 * len(self._registry) + SPARE:  # most are of forgotten tasks
            kept = {k: t for k, t in self._nonces.items() if self._registry.get(t) is not None}
            self._nonces = kept


def reused(nonce: int) -> Rejection:
    """Return the refusal of a nonce that another submission has."""
    return Rejection(TaskReason.NONCE_REUSED, f"nonce {nonce} was used for another task")


def _same_place(one: Draft, other: Draft, origin: GlobalPlace | None) -> bool:
    if not isinstance(one.goal, GoTo) or not isinstance(other.goal, GoTo):
        return False
    if (one.goal.yaw, one.goal.wait) != (other.goal.yaw, other.goal.wait):
        return False  # they do different things there
    first, second = one.goal.place, other.goal.place
    if first is None or second is None:
        return first is second
    if origin is None and isinstance(first, GlobalPlace) and isinstance(second, GlobalPlace):
        origin = first
    here, there = local_place(first, origin), local_place(second, origin)
    if here is None or there is None:
        return False
    return hypot(here.north - there.north, here.east - there.east) <= NEAR
