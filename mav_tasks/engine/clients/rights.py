"""What a client may do: its key, or else its address, gives it a role, and each role has limits.

Every client may stop a rover: STOP, pause, HOLD, disarm. A refusal names the rule that it follows.
"""

from collections.abc import Callable
from dataclasses import fields, replace
from math import isnan
from typing import NamedTuple

from mav_tasks.engine.clients.signatures import UNSIGNED
from mav_tasks.errors import Rejection
from mav_tasks.mavlink.signing import Key
from mav_tasks.settings import ROLES, Limits, Roles
from mav_tasks.tasks.driving.estimate import MOST_STEPS, Known, time_left
from mav_tasks.tasks.goal import (
    Goal,
    Nothing,
    Perform,
    Plan,
    SingleGoal,
    kind_of,
    speed_named_by,
)
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import Draft, Progress, Submitter, Task

R = TaskReason

OBSERVER, SUBMITTER, OPERATOR, SAFETY = ROLES
RANKS = {role: rank for rank, role in enumerate(ROLES)}
NO_LIMIT = Limits()
NUMBERS = tuple(each.name for each in fields(Limits) if each.name != "tasks")
SAME = 1 + 1e-6  # tolerance: a limit that was sent as a float32 is that limit
UNKNOWN_WAY = (
    f"the rover's position, its home or the place is not known, or it has over {MOST_STEPS} steps"
)


class Rights(NamedTuple):
    """The role of one client, and its limits."""

    role: str
    limits: Limits
    key: str = ""  # whose limits these are, for refusals; "": the role's

    @property
    def rank(self) -> int:
        """Position of the role among all roles; a higher one may do more."""
        return RANKS[self.role]

    def reach(self, role: str) -> bool:
        """Whether the client's role is this one or a higher one."""
        return RANKS[self.role] >= RANKS[role]

    def require(self, role: str, what: str) -> None:
        """Raise Rejection unless the client's role is this one or a higher one."""
        if RANKS[self.role] < RANKS[role]:
            raise self.refusal(f"may not {what}; {role} may")

    def require_own(self, task: Task, submitter: Submitter, what: str) -> None:
        """Raise Rejection unless the task is the submitter's own, or the role reaches operator."""
        self.require(SUBMITTER, what)
        if not self.reach(OPERATOR) and task.submitter.owner != submitter.owner:
            raise self.refusal(f"may not {what}: task {task.id} belongs to {task.submitter}")

    def refusal(self, words: str, reason: TaskReason = R.NOT_ALLOWED) -> Rejection:
        """Return a Rejection that names the role."""
        return Rejection(reason, f"role {self.role} {words}")

    def beyond(self, words: str, reason: TaskReason = R.NOT_ALLOWED) -> Rejection:
        """Return the Rejection of what is beyond a limit; it names the key, or else the role."""
        return Rejection(reason, f"{self.key or f'role {self.role}'} {words}")

    def check_priority(self, priority: int) -> None:
        """Raise Rejection if the role may not submit tasks of this priority."""
        most = self.limits.max_priority
        if priority > most:
            raise self.beyond(f"may use priority {most} at most, not {priority}")

    def check_preemptive(self) -> None:
        """Raise Rejection unless the role may submit pre-emptive tasks."""
        self.require(OPERATOR, "make a task pre-emptive")

    def checked(self, draft: Draft, *, waiting: int, known: Callable[[], Known]) -> Draft:
        """Return the draft, bounded to the client's limits; raise Rejection if it is not allowed.

        ``waiting``: how many tasks of its submitter wait already. ``known``: from where its rover
        will drive it, as far as that can be told.
        """
        self.require(SUBMITTER, "submit tasks")
        self.check_priority(draft.terms.priority)
        limits, goal = self.limits, draft.goal
        kinds = () if limits.tasks == NO_LIMIT.tasks else _kinds_of(goal)
        for kind in kinds:
            if kind not in limits.tasks:
                raise self.beyond(f"may not submit a {kind}, only {', '.join(limits.tasks)}")
        if not self.reach(OPERATOR) and _performs(goal):
            raise self.refusal("may not send a plan that contains rover commands")
        if draft.terms.is_preemptive:
            self.check_preemptive()
        if waiting >= limits.quota:
            raise self.beyond(f"may have at most {limits.quota} waiting tasks", R.QUOTA)
        top, most = limits.max_speed, limits.max_distance
        has_top, has_most = top < NO_LIMIT.max_speed, most < NO_LIMIT.max_distance
        if has_top and _fastest(goal) > top * SAME:
            raise self.beyond(f"may drive {top:g} m/s at most, not {_fastest(goal):g}")
        metres = time_left(goal, Progress(), known()).metres if has_most else 0.0
        if isnan(metres):
            raise self.beyond(f"may drive {most:g} m at most in a task: {UNKNOWN_WAY}")
        if has_most and metres > most * SAME:
            raise self.beyond(f"may drive {most:g} m at most in a task, not {metres:.2f}")
        if not has_top and not has_most:
            return draft
        terms = replace(
            draft.terms,
            top_speed=top if has_top else None,
            max_distance=most if has_most else None,
        )
        return replace(draft, terms=terms)


#: rights of a client that has sent nothing yet
NOTHING = Rights(OBSERVER, NO_LIMIT)


class RightsBook:
    """The rights of all clients, by key and address; a key may have limits of its own."""

    def __init__(self, roles: Roles) -> None:
        self._roles = roles
        self._by_role = {role: Rights(role, getattr(roles, role)) for role in ROLES}

    def __repr__(self) -> str:
        return f"RightsBook(unsigned: {self._roles.unsigned})"

    def of(self, key: Key, submitter: Submitter) -> Rights:
        """Return the rights of a submitter whose packet was signed with this key."""
        if key is not UNSIGNED:
            of_role = self._by_role[key.role]
            if not isinstance(key.limits, Limits):
                return of_role
            return Rights(key.role, tighter(of_role.limits, key.limits), f"key {key.name}")
        addresses = self._roles.addresses
        if not addresses:
            return self._by_role[self._roles.unsigned]
        by_address = addresses.get(submitter.address, self._roles.unsigned)
        return self._by_role[addresses.get(submitter.place, by_address)]


def tighter(one: Limits, other: Limits) -> Limits:
    """Return limits within which both are kept."""
    numbers = {name: min(getattr(one, name), getattr(other, name)) for name in NUMBERS}
    return Limits(tuple(kind for kind in one.tasks if kind in other.tasks), **numbers)


def _kinds_of(goal: Goal) -> list[str]:
    """Return the kinds of tasks in a goal; a plan of one step counts as that step."""
    if not isinstance(goal, Plan):
        return [kind_of(goal)]
    kinds = [kind_of(step) for step in goal.steps if isinstance(step, SingleGoal)]
    if len(kinds) == 1 and not _has_home(goal):
        return kinds
    return ["plan", *sorted(set(kinds))]


def _has_home(plan: Plan) -> bool:
    return plan.steps[:1] == (Nothing(),)


def _performs(goal: Goal) -> bool:
    return isinstance(goal, Plan) and any(isinstance(step, Perform) for step in goal.steps)


def _fastest(goal: Goal) -> float:
    """Return the highest speed that a goal names, m/s."""
    steps = goal.steps if isinstance(goal, Plan) else (goal,)
    return max((speed_named_by(step) for step in steps), default=0.0)
