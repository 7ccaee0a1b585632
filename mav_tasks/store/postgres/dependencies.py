"""Tasks that run after others, which perhaps another gateway has, as columns that SQL understands.

A gateway that waits for the end of a task is notified at the commit of that end. It also notifies
itself at the commit of each new dependency: the end may have been committed just before, when
nobody waited for it yet.
"""

from mav_tasks.store.batch import Batch
from mav_tasks.store.connection import Connection
from mav_tasks.tasks.lifecycle import TERMINAL

#: of NOTIFY; without contents: it only says that a look at the table is worth while
CHANNEL = "mav_tasks_expected"

#: a condition of a row of ``tasks``: a task that is not over runs after it
IS_EXPECTED = (
    "EXISTS (SELECT FROM tasks AS later WHERE later.run_after = tasks.id AND later.state < 9)"
)
_NOTIFY_IF_EXPECTED = (
    f"SELECT pg_notify('{CHANNEL}', '') WHERE EXISTS"
    " (SELECT FROM tasks WHERE run_after = ANY(?::bigint[]) AND state < 9)"
)


def write_dependencies(connection: Connection, batch: Batch) -> None:
    """Write what runs after what, after the rows of a batch and in its transaction."""
    if batch.run_after:
        connection.executemany(
            "UPDATE tasks SET run_after = nullif(?::bigint, 0) WHERE id = ?",
            list(batch.run_after.values()),
        )
        connection.execute(f"SELECT pg_notify('{CHANNEL}', '')")
    over = [task_id for state, _, _, task_id in batch.changed.values() if state in TERMINAL]
    over += [task_id for (task_id,) in batch.withdrawn]
    if over:
        connection.execute(_NOTIFY_IF_EXPECTED, (f"{{{','.join(map(str, over))}}}",))
