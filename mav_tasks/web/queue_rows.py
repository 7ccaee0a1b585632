"""Queues as the event stream sends them: whole at first, later only the rows that changed. Pure.

A halt, or the end of a task, changes numbers in every row. So the order carries these numbers, and
a row counts as changed only if something else in it changed.
"""

from typing import Any

Form = dict[str, Any]

#: of a row: sent for each task with the order, after its id
MOVING = ("position", "time_to_start", "time_to_finish")
#: of a row: also at the head of the queue
OF_THE_QUEUE = "halt_epoch"


class QueueRows:
    """The queues that the readers of the stream have, by rover."""

    def __init__(self) -> None:
        self._known: dict[int, Form] = {}

    def __repr__(self) -> str:
        return f"QueueRows({len(self._known)} queues)"

    def forms(self) -> list[Form]:
        """Return all queues, whole."""
        return list(self._known.values())

    def change(self, queue: Form) -> Form:
        """Store a queue. Return its QueueChange for readers that have the one before."""
        rover = queue["vehicle"]
        before = self._known.get(rover)
        known = {} if before is None else {row["id"]: _content(row) for row in before["waiting"]}
        self._known[rover] = queue
        waiting = queue["waiting"]
        return {name: value for name, value in queue.items() if name != "waiting"} | {
            "order": [[row["id"], *(row[name] for name in MOVING)] for row in waiting],
            "rows": [row for row in waiting if known.get(row["id"]) != _content(row)],
        }


def _content(row: Form) -> Form:
    return {name: value for name, value in row.items() if name not in (*MOVING, OF_THE_QUEUE)}
