"""Reads the state of a store, from which a server resumes.

Reading uses its own connection and one transaction: it sees one state of the store, whatever is
written meanwhile.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace
from itertools import groupby
from operator import itemgetter
from typing import Any

from mav_tasks.basics.errors import StoreError
from mav_tasks.store.codec import Decoder, Unreadable, loads
from mav_tasks.store.connection import Connection
from mav_tasks.store.event_database import Reader
from mav_tasks.tasks.events import (
    SignatureTime,
    TaskAdvanced,
    TaskAssigned,
    TaskChanged,
    TaskModified,
    TaskSubmitted,
)
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Task

CHUNK = 1_000  # rows whose JSON is parsed in one call
MOST_OVER = 1_000  # finished tasks of each vehicle that a gateway loads when it gets them

#: the fields that an event has in common with Task, besides the new state; in the order of the
#: columns (changed, modified, advanced, assigned) that keep the last event of each kind
_OF_TASK = {
    kind: tuple({f.name for f in fields(kind)} & {f.name for f in fields(Task)})
    for kind in (TaskChanged, TaskModified, TaskAdvanced, TaskAssigned)
}


def read_restored(
    reader: Reader,
    *,
    offset: float,
    ended_well: bool,
    idle: float,
    vehicles: frozenset[int] | None = None,
) -> Restored:
    """Return the state in a store, times reduced by ``offset``; raise StoreError.

    With ``vehicles``, what belongs to vehicles is returned of these only.
    """
    connection = reader.connection
    of_theirs, live_or_late = _only(vehicles)
    with in_one_line(reader), reader.snapshot():
        rows = Rows(connection)
        next_id, signed_until = connection.execute(
            "SELECT next_id, signed_until FROM meta"
        ).fetchone()
        found = connection.execute(
            f"SELECT submitted, changed, modified, advanced, assigned FROM tasks {live_or_late}"
            " ORDER BY number"
        )
        tasks: list[Task] = []
        while chunk := found.fetchmany(CHUNK):
            submitted = rows.values(TaskSubmitted, [row[0] for row in chunk], offset)
            for event, (_, *later) in zip(submitted, chunk, strict=True):
                task = event.task
                tasks.append(_changed(task, rows, later, offset) if any(later) else task)
        known = connection.execute(
            "SELECT vehicle, paused, uid, speed, halt_epoch, may_arm, halt_reason, halted_utc"
            f" FROM vehicles {of_theirs}"
        ).fetchall()
        plans = connection.execute(
            f"SELECT vehicle, kind, plan_id, source FROM plans {of_theirs}"
        ).fetchall()
        parameters = connection.execute("SELECT name, value FROM parameters").fetchall()
        signatures = connection.execute(
            "SELECT key, link_id, system_id, component_id, timestamp FROM signatures"
        ).fetchall()
        return Restored(
            tasks=tuple(tasks),
            next_id=next_id,
            paused={row[0]: TaskReason(row[1]) for row in known if row[1] is not None},
            uids={row[0]: row[2] for row in known if row[2] is not None},
            speeds={row[0]: row[3] for row in known if row[3] is not None},
            halt_epochs={row[0]: row[4] for row in known if row[4] is not None},
            halted={
                row[0]: (TaskReason(row[6]), row[7] - offset) for row in known if row[7] is not None
            },
            disarmed=frozenset(row[0] for row in known if row[5] == 0),
            plans={(row[0], row[1]): (row[2], row[3]) for row in plans if row[2]},
            parameters={name: value for name, value in parameters if value is not None},
            signatures=tuple(SignatureTime(*row) for row in signatures),
            signed_until=signed_until,
            ended_well=ended_well,
            idle=idle,
            wall_offset=offset,
        )


def read_parameters(reader: Reader) -> dict[str, float]:
    """Return the parameters that clients have set, by name; raise StoreError."""
    with in_one_line(reader):
        found = reader.connection.execute("SELECT name, value FROM parameters").fetchall()
        return {name: value for name, value in found if value is not None}


def _only(vehicles: frozenset[int] | None) -> tuple[str, str]:
    """Return conditions of rows of some vehicles, and of their tasks; "": all."""
    if vehicles is None:
        return "", ""
    listed = ",".join(map(str, sorted(vehicles))) or "NULL"
    theirs = f"WHERE vehicle IN ({listed})"
    late = " UNION ALL ".join(
        f"SELECT * FROM (SELECT id FROM tasks WHERE vehicle = {vehicle:d}"
        f" AND state >= {TaskState.COMPLETED:d} ORDER BY changed_at DESC LIMIT {MOST_OVER})"
        f" AS of_{vehicle:d}"
        for vehicle in sorted(vehicles)
    )
    late = late or "NULL"
    return theirs, f"{theirs} AND (state < {TaskState.COMPLETED:d} OR id IN ({late}))"


class Rows:
    """Decodes stored texts, each by the format in which it was written."""

    def __init__(self, connection: Connection) -> None:
        self._decoders = {
            number: Decoder(loads(names))
            for number, names in connection.execute("SELECT id, names FROM formats")
        }

    def values(self, kind: type, texts: list[str], offset: float) -> list[Any]:
        values: list[Any] = []
        rows = loads(f"[{','.join(texts)}]")
        for number, of_format in groupby(rows, key=itemgetter(0)):
            bare = [row[1:] for row in of_format]
            values += self._decoders[number].values(kind, bare, offset=offset)
        return values


def _changed(task: Task, rows: Rows, texts: Sequence[str | None], offset: float) -> Task:
    latest: list[TaskChanged | TaskModified | TaskAdvanced | TaskAssigned] = []
    for kind, text in zip(_OF_TASK, texts, strict=True):
        if text is not None:
            latest += rows.values(kind, [text], offset)
    for event in sorted(latest, key=lambda event: event.version):
        new: dict[str, Any] = {name: getattr(event, name) for name in _OF_TASK[type(event)]}
        if isinstance(event, TaskChanged):
            new["state"], new["changed_at"] = event.new, event.at
        task = replace(task, **new)
    return task


@contextmanager
def in_one_line(reader: Reader) -> Iterator[None]:
    """Convert every error of reading to a StoreError with a text of one line."""
    try:
        yield
    except Unreadable as error:
        raise StoreError(f"store {reader.name}: its contents are invalid: {error}") from error
    except StoreError as error:
        raise StoreError(f"store {reader.name}: {error}") from error
    except (ValueError, LookupError) as error:  # not JSON, or not what we write
        raise StoreError(f"store {reader.name}: it is damaged ({error})") from error
    except Exception as error:
        words = reader.failure(error)
        if words is None:
            raise
        raise StoreError(f"store {reader.name}: {words}") from error
