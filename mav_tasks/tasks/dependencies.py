"""Dependencies between tasks (``Terms.after``), and checks whether they can be met.

In a fleet a task may run after one of a vehicle that another gateway has. The registry lacks that
one; the fleet's store says how it stands, and ``expected`` are the tasks that it is asked about. A
task that the registry lacks counts as not over until the store says that it is: whoever has lost
sight of a task must not start what waits for it. What the store says never turns back: a task is
there, and later it has ended.

Dependencies have no circle. A new task may name only one that exists, so none waits for it yet. A
waiting task may be changed to run after another one only if all that this one waits for is known
here: the gateways have nothing in common that could find a circle over several of them.
"""

from collections.abc import Mapping

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
        #: whether tasks that the registry lacks may be another gateway's
        self.is_shared = False
        #: the tasks with dependents that the registry lacks
        self.expected: set[int] = set()
        #: what the fleet's store says, while that is handled; None: there is no such task
        self.told: Mapping[int, TaskState | None] = {}

    def __repr__(self) -> str:
        return f"Dependencies(of {len(self._dependents)} tasks)"

    def __contains__(self, task_id: TaskId) -> bool:
        return task_id in self._dependents

    def of(self, task_id: TaskId) -> tuple[TaskId, ...]:
        """Return the tasks that run after this one, in the order in which they were added."""
        return tuple(self._dependents.get(task_id, ()))

    def add(self, task_id: TaskId, after: int) -> None:
        """Note that a task runs after another one."""
        self._dependents.setdefault(TaskId(after), {})[task_id] = None
        if self.is_shared and self._registry.get(after) is None:
            self.expected.add(after)

    def take(self, task_id: TaskId) -> tuple[TaskId, ...]:
        """Remove and return the tasks that run after this one, which has ended."""
        self.expected.discard(task_id)
        return tuple(self._dependents.pop(task_id, ()))

    def forget(self, task_id: TaskId, after: int) -> bool:
        """Remove a dependency. Return whether there was one."""
        dependents = self._dependents.get(TaskId(after)) if after else None
        if dependents is None or task_id not in dependents:
            return False
        del dependents[task_id]
        if not dependents:
            del self._dependents[TaskId(after)]
            self.expected.discard(after)
        return True

    def look_again(self) -> list[TaskId]:
        """Take that the registry has other tasks now; return the expected ones that are over."""
        before = self.expected
        if self.is_shared:
            lacks = (each for each in self._dependents if self._registry.get(each) is None)
            self.expected = set(lacks)
        return [TaskId(each) for each in sorted(before) if self._is_over_here(each)]

    def is_in_question(self, after: int) -> bool:
        """Return whether only the fleet's store can say whether the task ``after`` exists."""
        is_known = after in self.expected or after in self.told
        return self.is_shared and not is_known and self._registry.get(after) is None

    def check(self, after: int) -> None:
        """Raise Rejection if a task could never run after this one."""
        task = self._registry.get(after)
        state = self.told.get(after) if task is None else task.state
        if state is None and after not in self.expected:
            raise Rejection(R.UNKNOWN_DEPENDENCY, f"run after {after}: no such task")
        if state is not None and state in TERMINAL and state is not S.COMPLETED:
            words = f"run after {after}: that task has ended ({state.name.lower()})"
            raise Rejection(R.DEPENDENCY_FAILED, words)

    def check_here(self, after: int) -> None:
        """Raise Rejection if a waiting task cannot be changed to run after this one."""
        if self.is_shared and self._registry.get(after) is None:
            words = f"run after {after}: no rover of this gateway has that task:"
            words += " cancel this one, and submit it again to run after that"
            raise Rejection(R.UNKNOWN_DEPENDENCY, words)
        self.check(after)

    def check_cycle(self, task: Task, after: int) -> None:
        """Raise Rejection if a task would wait for itself, directly or through others."""
        seen: int = after
        while seen:
            if seen == task.id:
                raise Rejection(R.CYCLE, f"run after {after}: the tasks would wait for each other")
            if seen in self.expected:
                words = f"run after {after}: that one waits for task {seen} of another gateway"
                raise Rejection(R.CYCLE, f"{words}; perhaps the tasks would wait for each other")
            ahead = self._registry.get(seen)
            seen = 0 if ahead is None or ahead.state not in WAITING else ahead.terms.after

    def is_waited_for(self, after: int) -> bool:
        """Return whether the task ``after`` is not over, as far as is known."""
        task = self._registry.get(after)
        return self.is_shared if task is None else task.state not in TERMINAL

    def has_completed(self, after: int) -> bool:
        """Return whether the task ``after`` is known to have completed."""
        task = self._registry.get(after)
        return (self.told.get(after) if task is None else task.state) is S.COMPLETED

    def was_met(self, task: Task) -> bool:
        """Return whether the state of a stored task shows that the one before it had completed.

        Only that lets a task become ready. By now the store may have deleted the one before it.
        """
        after = task.terms.after
        is_elsewhere = self.is_shared and after and self._registry.get(after) is None
        return bool(is_elsewhere) and task.state is S.QUEUED

    def have_failed(self, task: Task) -> bool:
        """Return whether the task that this one runs after ended without being completed."""
        ahead = self._registry.get(task.terms.after) if task.terms.after else None
        return ahead is not None and ahead.state in TERMINAL and ahead.state is not S.COMPLETED

    def _is_over_here(self, task_id: int) -> bool:
        task = self._registry.get(task_id)
        return task is not None and task.state in TERMINAL
