"""Dependencies between tasks (``Terms.after``), and checks whether they can be met."""

from collections.abc import Collection, Iterator

from mav_tasks.errors import Rejection
from mav_tasks.tasks.lifecycle import TERMINAL, WAITING, TaskReason, TaskState
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Task, TaskId

R, S = TaskReason, TaskState


class Dependencies:
    """Index of dependents: for each task, the tasks that run after it."""

    def __init__(self, registry: TaskRegistry) -> None:
        self._registry = registry
        self._dependents: dict[TaskId, dict[TaskId, None]] = {}

    def __repr__(self) -> str:
        return f"Dependencies(of {len(self._dependents)} tasks)"

    def __contains__(self, task_id: TaskId) -> bool:
        return task_id in self._dependents

    def of(self, task_id: TaskId) -> tuple[TaskId, ...]:
        """Return the tasks that run after this one, in the order in which they were added."""
        return tuple(self._dependents.get(task_id, ()))

    def pairs(self) -> Iterator[tuple[TaskId, Collection[TaskId]]]:
        """Yield each task that is waited for, with those that run after it."""
        yield from self._dependents.items()

    def add(self, task_id: TaskId, after: int) -> None:
        """Note that a task runs after another one."""
        self._dependents.setdefault(TaskId(after), {})[task_id] = None

    def take(self, task_id: TaskId) -> tuple[TaskId, ...]:
        """Remove and return the tasks that run after this one, which has ended."""
        return tuple(self._dependents.pop(task_id, ()))

    def forget(self, task_id: TaskId, after: int) -> bool:
        """Remove a dependency. Return whether there was one."""
        dependents = self._dependents.get(TaskId(after)) if after else None
        if dependents is None or task_id not in dependents:
            return False
        del dependents[task_id]
        if not dependents:
            del self._dependents[TaskId(after)]
        return True

    def check(self, after: int) -> None:
        """Raise Rejection if a task could never run after this one."""
        task = self._registry.get(after)
        if task is None:
            raise Rejection(R.UNKNOWN_DEPENDENCY, f"run after {after}: no such task")
        if task.state in TERMINAL and task.state is not S.COMPLETED:
            words = f"run after {after}: that task has ended ({task.state.name.lower()})"
            raise Rejection(R.DEPENDENCY_FAILED, words)

    def check_cycle(self, task: Task, after: int) -> None:
        """Raise Rejection if a task would wait for itself, directly or through others."""
        seen: int = after
        while seen:
            if seen == task.id:
                raise Rejection(R.CYCLE, f"run after {after}: the tasks would wait for each other")
            ahead = self._registry.get(seen)
            seen = 0 if ahead is None or ahead.state not in WAITING else ahead.terms.after

    def is_waited_for(self, after: int) -> bool:
        """Return whether the task ``after`` exists and is not over."""
        task = self._registry.get(after)
        return task is not None and task.state not in TERMINAL

    def have_failed(self, task: Task) -> bool:
        """Return whether the task that this one runs after ended without being completed."""
        ahead = self._registry.get(task.terms.after) if task.terms.after else None
        return ahead is not None and ahead.state in TERMINAL and ahead.state is not S.COMPLETED
