"""Goals → commands and mission items, in the units and parameters of the dialect. Pure.

Move, Rotate and Drive are sent as commands with a nonce and task options. Any other goal is sent as
a plan whose TASK_OPTIONS item carries both. So a repeated submission is one task, and two equal
submissions are two tasks.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from mav_tasks.engine.services.missions import Item
from mav_tasks.kinds import Act, Drive, Face, GoTo, Move, Rotate, Wait
from mav_tasks.kinds.sent import LARGEST, check_numbers, check_size
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavFrame
from mav_tasks.mavlink.float_param import to_param
from mav_tasks.plans.values import PlanItem
from mav_tasks.tasks.repetition import canonical
from mav_tasks.tasks.task import DEFAULT_PRIORITY, MAX_NONCE, MAX_PRIORITY, MAX_TASK_ID

#: the goals that a client can submit; angles in radians
Goal = Move | Rotate | Drive | GoTo | Face | Wait | Act

#: the address of the task server itself, where it takes tasks for any of its rovers
SERVER = Address(250, 191)


@dataclass(frozen=True, slots=True)
class TaskOptions:
    """When and how a task runs; ``delay`` and ``deadline`` in seconds from now."""

    priority: int = DEFAULT_PRIORITY
    after: int = 0
    delay: float = 0.0
    deadline: float = 0.0

    def __post_init__(self) -> None:
        _whole("priority", self.priority, 0, MAX_PRIORITY)
        _whole("after", self.after, 0, MAX_TASK_ID)
        for name, value in (("delay", self.delay), ("deadline", self.deadline)):
            if not (isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} {value!r}: expected seconds, 0 or more")
            check_size(name, value)


def repeat_of(every: float | str) -> str:
    """Return the text of a repetition: seconds, or a cron expression; "" for 0 or "".

    Raise ValueError if it is invalid. A time zone is looked up here, too.
    """
    if isinstance(every, str):
        return canonical(every) if every else ""
    if isinstance(every, bool) or not isfinite(every) or every != int(every):
        raise ValueError(f"every {every!r}: expected whole seconds, or a cron expression")
    return canonical(f"{every:.0f}") if every else ""


def check_nonce(nonce: int) -> None:
    """Raise ValueError unless this is a nonce, or 0 for none."""
    _whole("nonce", nonce, 0, MAX_NONCE)


def check_check(check: int) -> None:
    """Raise ValueError unless this is a number that can accompany a nonce."""
    _whole("check", check, 0, LARGEST)


def command_of(
    goal: Move | Rotate | Drive, terms: TaskOptions, *, target: tuple[int, int], nonce: int
) -> m.CommandLong:
    """Return the command that submits a goal. The deadline is set afterwards."""
    check_numbers(goal)
    (own,) = goal.sent
    options = to_param(nonce), to_param(terms.after), terms.delay, float(terms.priority)
    return m.CommandLong(*target, own.command, 0, *own[1:4], *options)


def items_of_goals(goals: Sequence[Goal]) -> tuple[Item, ...]:
    """Return the items of a plan that drives the goals in order."""
    for goal in goals:
        if not isinstance(goal, Goal):
            raise ValueError(f"{goal!r}: expected a goal, such as Move(2.0)")
        check_numbers(goal)
    return tuple(
        Item(i.frame, i.command, 0, 1, *i[1:5], i.x, i.y, i.z) for goal in goals for i in goal.sent
    )


def items_of_file(items: Sequence[PlanItem]) -> tuple[Item, ...]:
    """Return the items of a file as mission items."""
    return tuple(
        Item(i.frame, i.command, 0, int(i.autocontinue), *i.params, i.x, i.y, i.z) for i in items
    )


def file_items(items: Sequence[Item]) -> tuple[PlanItem, ...]:
    """Return downloaded items as items of a file: the inverse of ``items_of_file``."""
    return tuple(
        PlanItem(
            i.command,
            i.frame,
            (i.param1, i.param2, i.param3, i.param4),
            i.x,
            i.y,
            i.z,
            bool(i.autocontinue),
        )
        for i in items
    )


def with_home(items: Sequence[Item]) -> tuple[Item, ...]:
    """Return the items after a home item, as in ArduPilot; DO_JUMP targets move by one."""
    home = Item(MavFrame.GLOBAL, MavCmd.NAV_WAYPOINT, 0, 1, 0.0, 0.0, 0.0, 0.0, 0, 0, 0.0)
    moved = (
        item._replace(param1=item.param1 + 1) if item.command == MavCmd.DO_JUMP else item
        for item in items
    )
    return (home, *moved)


def options_of(terms: TaskOptions, *, nonce: int, check: int = 0) -> Item:
    """Return the TASK_OPTIONS item of a plan.

    It goes last, so that the targets of jumps stay right. The nonce tells this plan from an equal
    one, and lets the server recognize a late copy. A plan with this nonce and another ``check``
    is another plan, which the server refuses.
    """
    own = float(terms.priority), terms.delay, terms.deadline, to_param(terms.after)
    return Item(MavFrame.MISSION, MavCmd.TASK_OPTIONS, 0, 1, *own, nonce, check, 0.0)


def _whole(name: str, value: int, low: int, high: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise ValueError(f"{name} {value!r}: expected a whole number from {low} to {high}")
