"""What an acknowledgement waits for: the disk, or what another gateway of the fleet knows.

``CommitGate`` holds effects back until all events recorded so far are durable, each with a time
limit. The answer to a command that halts a vehicle may leave earlier: once the store has kept the
halts. Effects that wait for the same are carried out in the order in which they came.

``DependencyQuestions`` holds submissions back that run after a task which only the fleet's store
knows: a task of a vehicle that another gateway has, or one that does not exist.
``Engine.expected`` names it until the store has answered (``TasksElsewhere``); then the submission
is handled again, by the state of its vehicle at that time. So a halt that came meanwhile counts.
"""

from collections import deque
from math import inf
from operator import itemgetter
from typing import NamedTuple, Protocol

from mav_tasks.basics.errors import Rejection
from mav_tasks.engine.timers import Effect, Timers, Turn
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.pending_tasks import PendingTasks
from mav_tasks.tasks.registry import TaskRegistry

WITHIN = 1.0  # s for the answer; clients wait longer for theirs
MOST = 256  # submissions

R = TaskReason


class Refuse(Protocol):
    """Refuses what a client asked for."""

    def __call__(self, refusal: Rejection, /, *, now: float) -> None: ...


class _Question(NamedTuple):
    after: int
    until: float
    go_on: Effect
    refuse: Refuse


class DependencyQuestions:
    """The submissions that wait for an answer, in the order in which they came."""

    def __init__(self, room: PendingTasks, timers: Timers) -> None:
        self._room = room
        self.held: deque[_Question] = deque()  #: in the order in which they came
        self._timer = timers.timer(Turn.SUBMISSIONS, self._give_up_late)

    @property
    def expected(self) -> set[int]:
        """The tasks that are asked about."""
        return {held.after for held in self.held}

    def hold(self, after: int, go_on: Effect, refuse: Refuse, *, now: float) -> bool:
        """Hold a submission back if that is necessary; return whether it is held.

        Raise Rejection if too many are. ``go_on`` handles it again, or raises Rejection.
        """
        if not self._room.is_in_question(after):
            return False
        if len(self.held) >= MOST:
            raise Rejection(R.RATE_LIMITED, f"run after {after}: too many such submissions wait")
        self.held.append(_Question(after, now + WITHIN, go_on, refuse))
        self._plan()
        return True

    def answered(self, *, now: float) -> None:
        """Handle those whose task is no longer in question."""
        held, self.held = self.held, deque()
        for each in held:
            if self._room.is_in_question(each.after):
                self.held.append(each)
                continue
            try:
                each.go_on(now=now)
            except Rejection as refusal:
                each.refuse(refusal, now=now)
        self._plan()

    def keys_revoked(self, *, now: float) -> None:
        """Refuse all: the rights of one may have been those of a key that is no longer valid."""
        held, self.held = self.held, deque()
        for each in held:
            each.refuse(Rejection(R.STALE, "a key was revoked meanwhile: send it again"), now=now)
        self._plan()

    def _give_up_late(self, *, now: float) -> None:
        while self.held and self.held[0].until <= now:
            after, _, _, refuse = self.held.popleft()
            words = f"run after {after}: the fleet's database did not say within {WITHIN:g} s"
            words += " whether that task exists: submit it again"
            refuse(Rejection(R.STORE_UNAVAILABLE, words), now=now)
        self._plan()

    def _plan(self) -> None:
        self._timer.set(self.held[0].until if self.held else inf)


class _Held(NamedTuple):
    """The event that must be kept, until when, and whether only the halts must be; and effects."""

    number: int
    until: float
    is_halt: bool
    accept: Effect
    give_up: Effect


class CommitGate:
    """The effects that wait, in the order in which they came."""

    def __init__(self, registry: TaskRegistry, timers: Timers, *, within: float) -> None:
        """``within``: seconds that each effect waits at most."""
        self._registry = registry
        self.within = within
        self._held: list[_Held] = []
        self.halts_kept = 0  #: number of the event up to which the halts are kept
        self._timer = timers.timer(Turn.SUBMISSIONS, self.look)

    def __len__(self) -> int:
        return len(self._held)

    def hold(self, accept: Effect, give_up: Effect, *, now: float, is_halt: bool = False) -> None:
        """Do ``accept`` once all events recorded so far are durable, or ``give_up`` if late.

        ``is_halt``: it is enough that the halts among them are kept.
        """
        number, until = self._registry.recorded, now + self.within
        if number <= self._registry.durable or (is_halt and number <= self.halts_kept):
            accept(now=now)
            return
        if not self._held:
            self._timer.set(until)
        self._held.append(_Held(number, until, is_halt, accept, give_up))

    def look(self, *, now: float) -> None:
        """Carry out what need not wait any more, and give up what has waited too long."""
        waiting, self._held, durable = self._held, [], self._registry.durable
        for held in waiting:
            number, until, is_halt, accept, give_up = held
            if number <= durable or (is_halt and number <= self.halts_kept):
                accept(now=now)
            elif until <= now:
                give_up(now=now)
            else:
                self._held.append(held)
        self._timer.set(min(map(itemgetter(1), self._held), default=inf))
