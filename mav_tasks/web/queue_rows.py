"""Queues as the event stream sends them: whole at first, later only the rows that changed. Pure.

A halt, or a task that ends, changes the numbers of every row. So those that move with the queue are
sent beside the order, and count as no change of a row.
"""

from typing import Any

Form = dict[str, Any]

#: of a row: sent for each task with the order, after its id
MOVING = ("position", "time_to_start", "time_to_finish")
#: of a row: also at the head of the queue
OF_THE_QUEUE = "halt_epoch"


class QueueRows:
    """The queues as the readers of the stream know them, by rover."""

    def __init__(self) -> None:
        self._known: dict[int, Form] = {}

    def __repr__(self) -> str:
        return f"QueueRows({len(self._known)} queues)"

    def forms(self) -> list[Form]:
        """Return all queues, whole."""
        return list(self._known.values())

    def change(self, queue: Form) -> Form:
        """Return what a queue has become for who knows it as it was: see QueueChange."""
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
