"""What a client may do: its key, or else its address, gives it a role, and each role has limits.

Every client may stop a rover: STOP, pause, HOLD, disarm. A refusal names the rule that it follows.
"""

from collections.abc import Callable
from dataclasses import replace
from math import isnan
from typing import NamedTuple

from mav_tasks.basics.errors import Rejection
from mav_tasks.config.settings import ROLES, Limits, Roles
from mav_tasks.engine.clients.signatures import UNSIGNED
from mav_tasks.kinds import Act, SingleGoal
from mav_tasks.mavlink.signing import Key
from mav_tasks.tasks.driving.estimate import MOST_STEPS, Known, time_left
from mav_tasks.tasks.goal import Goal, Perform, Plan, steps_of
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import Draft, Progress, Submitter, Task, Terms

R = TaskReason

OBSERVER, SUBMITTER, OPERATOR, SAFETY = ROLES
RANKS = {role: rank for rank, role in enumerate(ROLES)}
NO_LIMIT = Limits()
SAME = 1 + 1e-6  # tolerance: a limit that was sent as a float32 is that limit
UNKNOWN_WAY = f"unknown (position, home or place; or over {MOST_STEPS} steps)"
UNASKED = Terms(priority=-1)  # of what is not there yet


class Rights(NamedTuple):
    """The role of one client, and its limits."""

    role: str
    limits: Limits
    key: str = ""  # whose limits these are, for refusals; "": the role's
    #: its own limits bound speed or way: it drives by tasks alone, which the server drives
    is_bound: bool = False

    @property
    def rank(self) -> int:
        """Position of the role among all roles; a higher one may do more."""
        return RANKS[self.role]

    def reach(self, role: str) -> bool:
        """Whether the client's role is this one or a higher one."""
        return RANKS[self.role] >= RANKS[role]

    @property
    def may_drive(self) -> bool:
        """Whether the client may drive by set-points of its own."""
        return self.reach(OPERATOR) and not self.is_bound

    def require(self, role: str, what: str, *, moves: bool = False) -> None:
        """Raise Rejection unless the client's role is this one or a higher one.

        ``moves``: it may move a rover, and how fast and how far is not the server's to say.
        """
        if RANKS[self.role] < RANKS[role]:
            raise self.refusal(f"may not {what}; {role} may")
        if moves and self.is_bound:
            raise self.refusal(f"may not {what}: its limits of speed or way allow only tasks")

    def require_own(self, task: Task, submitter: Submitter, what: str) -> None:
        """Raise Rejection unless the task is the submitter's own, or the role reaches operator."""
        self.require(SUBMITTER, what)
        if not self.reach(OPERATOR) and task.submitter.owner != submitter.owner:
            raise self.refusal(f"may not {what}: task {task.id} belongs to {task.submitter}")

    def refusal(self, words: str, reason: TaskReason = R.NOT_ALLOWED) -> Rejection:
        """Return a Rejection that names the role, or the key if that has limits of its own."""
        return Rejection(reason, f"{self.key or f'role {self.role}'} {words}")

    def check_terms(self, terms: Terms, before: Terms = UNASKED) -> None:
        """Raise Rejection if terms, of a new task or in place of others, are not allowed."""
        most = self.limits.max_priority
        if most < NO_LIMIT.max_priority and terms.standing > max(most, before.standing):
            raise self.refusal(f"may use priority {most} at most, not {terms.standing}")
        if terms.is_preemptive > before.is_preemptive:
            self.require(OPERATOR, "make a task pre-emptive")

    def checked(
        self, draft: Draft, *, waiting: Callable[[], int], known: Callable[[], Known]
    ) -> Draft:
        """Return the draft, bounded to the client's limits; raise Rejection if it is not allowed.

        ``waiting``: returns how many tasks of its submitter wait already. ``known``: from where
        its rover will drive it, as far as that can be told.
        """
        self.check_content(draft)
        limits = self.limits
        if limits.quota < NO_LIMIT.quota and waiting() >= limits.quota:
            raise self.refusal(f"may have at most {limits.quota} waiting tasks", R.QUOTA)
        top, most = limits.max_speed, limits.max_distance
        is_far = most >= NO_LIMIT.max_distance
        metres = 0.0 if is_far else time_left(draft.goal, Progress(), known()).metres
        if not metres <= most * SAME:  # also if it is not known
            way = UNKNOWN_WAY if isnan(metres) else f"{metres:.2f} m"
            raise self.refusal(f"may drive {most:g} m at most in a task, not {way}")
        if is_far and top >= NO_LIMIT.max_speed:
            return draft
        terms = replace(draft.terms, top_speed=top, max_distance=None if is_far else most)
        return replace(draft, terms=terms)

    def check_content(self, draft: Draft) -> None:
        """Raise Rejection if a task is not allowed, whichever rover drives it."""
        self.require(SUBMITTER, "submit tasks")
        self.check_terms(draft.terms)
        limits, goal = self.limits, draft.goal
        kinds = () if limits.tasks == NO_LIMIT.tasks else _kinds_of(goal)
        for kind in kinds:
            if kind not in limits.tasks:
                raise self.refusal(f"may not submit a {kind}, only {', '.join(limits.tasks)}")
        if isinstance(goal, Plan):
            roles = {step.role for step in goal.steps if isinstance(step, Perform | Act)}
            for role in (OPERATOR, SAFETY):
                if role in roles:
                    words = "" if role == OPERATOR else f" for {role}"
                    words = f"send a plan that contains rover commands{words}"
                    self.require(role, words, moves=True)
        top = limits.max_speed
        if top < NO_LIMIT.max_speed:
            fastest = max((step.named_speed for step in steps_of(goal)), default=0.0)
            if fastest > top * SAME:
                raise self.refusal(f"may drive {top:g} m/s at most, not {fastest:g}")


#: rights of a client that has sent nothing yet
NOTHING = Rights(OBSERVER, NO_LIMIT)


def rights_of(key: Key, submitter: Submitter, roles: Roles) -> Rights:
    """Return the rights of a submitter whose packet was signed with this key.

    A key may have limits of its own.
    """
    role = key.role
    if key is UNSIGNED:
        by_address = roles.addresses.get(submitter.address, roles.unsigned)
        role = roles.addresses.get(submitter.place, by_address)
    limits, own = getattr(roles, role), key.limits
    if not isinstance(own, Limits):
        return Rights(role, limits)
    is_slow, is_near = own.max_speed < NO_LIMIT.max_speed, own.max_distance < NO_LIMIT.max_distance
    return Rights(role, limits.within(own), f"key {key.name}", is_slow or is_near)


def _kinds_of(goal: Goal) -> list[str]:
    """Return the kinds of tasks in a goal; a plan of one step counts as that step."""
    if not isinstance(goal, Plan):
        return [goal.rule]
    kinds = [step.rule for step in goal.steps if isinstance(step, SingleGoal)]
    if len(kinds) == 1 and not goal.has_home:
        return kinds
    return ["plan", *sorted(set(kinds))]
