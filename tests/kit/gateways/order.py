"""Whether tasks ran after those that they had to wait for, by what was stored."""

from collections.abc import Iterable

from mav_tasks.tasks.events import Event, TaskChanged, TaskModified, TaskSubmitted
from mav_tasks.tasks.lifecycle import TaskState as S


def early_starts(events: Iterable[Event]) -> list[str]:
    """Return the starts that were stored before the end of the task ahead, in words."""
    after: dict[int, int] = {}
    completed: set[int] = set()
    found: list[str] = []
    for event in events:
        match event:
            case TaskSubmitted(task=task):
                after[task.id] = task.terms.after
            case TaskModified():
                after[event.task_id] = event.terms.after
            case TaskChanged(new=S.COMPLETED):
                completed.add(event.task_id)
            case TaskChanged(new=S.STARTING | S.QUEUED):
                ahead = after[event.task_id]
                if ahead and ahead not in completed:
                    found.append(f"{event}, before task {ahead} was over")
            case _:
                pass
    return found
