"""Joins the events of one change: a client sets the properties of a task one by one. Pure."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from mav_tasks.tasks.events import Event, TaskModified, TaskSubmitted, changes_of

#: event number over the life of the store, event
Entry = tuple[int, Event]

WITHIN = 2.0  # s between two events of one change


def joined(entries: Iterable[Entry]) -> Iterator[tuple[int, Event, str]]:
    """Yield the first event of each change, with the number of its last one and the text of all."""
    group: list[Entry] = []
    for entry in entries:
        if group and not _continues(entry[1], group[-1][1]):
            yield _one(group)
            group = []
        group.append(entry)
    if group:
        yield _one(group)


def _continues(event: Event, last: Event) -> bool:
    """Return whether an event is of the same client's change of the same task as the one before."""
    if not isinstance(event, TaskModified) or event.at - last.at > WITHIN:
        return False
    match last:
        case TaskSubmitted(task=task):
            return (event.task_id, event.actor) == (task.id, str(task.submitter))
        case TaskModified():
            return (event.task_id, event.actor) == (last.task_id, last.actor)
    return False


def _one(group: Sequence[Entry]) -> tuple[int, Event, str]:
    number, first = group[-1][0], group[0][1]
    if len(group) == 1:
        return number, first, str(first)
    changes = [event for _, event in group if isinstance(event, TaskModified)]
    head = replace(first, before=None) if isinstance(first, TaskModified) else first
    return number, first, f"{head}: {', '.join(_parts(changes)) or 'no change'}"


def _parts(changes: Sequence[TaskModified]) -> Iterator[str]:
    """Yield what each event changed; a label, which comes in pieces, is whole at the end."""
    first, last = changes[0], changes[-1]
    for each in changes:
        before = each.before or each.terms
        terms = replace(each.terms, label=before.label)
        if words := changes_of(before, terms, at=each.at):
            yield words
    before = replace(last.terms, label=(first.before or first.terms).label)
    if words := changes_of(before, last.terms, at=last.at):
        yield words
