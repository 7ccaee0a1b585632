"""The journal of a store on this machine, for the page: what happened to a task, and its places."""

import time
from collections import deque
from contextlib import closing
from itertools import islice
from typing import Any

from mav_tasks.basics.errors import StoreError
from mav_tasks.shell.logs.export import for_people
from mav_tasks.shell.logs.joined import joined
from mav_tasks.store.base import Which
from mav_tasks.store.opening import kind_of
from mav_tasks.store.rendering import event_values
from mav_tasks.tasks.events import TaskSubmitted
from mav_tasks.tasks.task import Task

DAY = 24 * 3600.0


class Journal:
    """Reads a store's journal. Methods block: call them in a thread. They raise StoreError."""

    def __init__(self, place: str) -> None:
        self._place = place

    def __repr__(self) -> str:
        return f"Journal({self._place})"

    def is_readable(self) -> bool:
        """Return whether there is a store that can be read."""
        try:
            with closing(kind_of(self._place).open_journal(self._place, Which(task=0))):
                return True
        except StoreError:
            return False

    def entries(
        self, *, task: int | None, vehicle: int | None, after: int | None, limit: int
    ) -> list[dict[str, Any]]:
        """Return the first events after a number; None: the latest, without a task of a day."""
        since = time.time() - DAY if task is None and after is None else None
        which = Which(task=task, vehicle=vehicle, since=since, after=after)
        with closing(kind_of(self._place).open_journal(self._place, which)) as reader:
            events = joined(reader.take(offset=0.0))
            found = deque(events if after is None else islice(events, limit), maxlen=limit)
        return [
            {"number": number, "at": round(event.at, 3)}
            | event_values(event, offset=0.0)
            | {"message": for_people(words)}
            for number, event, words in found
        ]

    def submission_of(self, task: int) -> Task | None:
        """Return a task as it was submitted; None if the journal does not have it."""
        with closing(kind_of(self._place).open_journal(self._place, Which(task=task))) as reader:
            events = (event for _, event in reader.take(offset=0.0))
            return next((each.task for each in events if isinstance(each, TaskSubmitted)), None)
