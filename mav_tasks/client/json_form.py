"""Tasks, queues and rovers as JSON: the form of the command line, the HTTP API and agents.

Each part is declared once: its name, where it comes from, its schema. Angles are in degrees here.
Unknown values are null.
"""

from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from math import degrees, inf
from operator import attrgetter
from typing import Any

from mav_tasks.client.descriptions import end_of, left, state_of, waits_of, what_of
from mav_tasks.client.values import QueueStatus, TaskStatus, TaskTiming, VehicleStatus
from mav_tasks.config.setting_keys.schema import (
    FLAG,
    INTEGER,
    NUMBER,
    TEXT,
    Schema,
    listed,
    or_null,
    ref,
    said,
    words,
)
from mav_tasks.tasks.lifecycle import TaskReason, TaskState

Form = dict[str, Any]
#: by name: what returns the part of a value, and its schema
Parts = Mapping[str, tuple[Callable[[Any], Any], Schema]]

REASON = words([reason.name.lower() for reason in TaskReason])
SECONDS = or_null(NUMBER, "s")


def form_of(parts: Parts, value: object) -> Form:
    """Return a value as JSON."""
    return {name: of(value) for name, (of, _) in parts.items()}


def schemas_of(parts: Parts) -> dict[str, Schema]:
    """Return the schema of each part."""
    return {name: schema for name, (_, schema) in parts.items()}


def _given(name: str) -> Callable[[Any], Any]:
    """Return what reads an attribute; null instead of 0 and ""."""
    return lambda value: getattr(value, name) or None


def _number(name: str) -> Callable[[Any], float | None]:
    return lambda value: _rounded(getattr(value, name))


def _of_type(name: str, kind: type) -> Callable[[Any], Any]:
    return lambda value: found if isinstance(found := getattr(value, name), kind) else None


def _ended_at(status: TaskStatus) -> str | None:
    if status.ended_ago is None:
        return None
    at = datetime.now(UTC) - timedelta(seconds=status.ended_ago)
    return at.isoformat(timespec="milliseconds")


def _age(value: QueueStatus | VehicleStatus) -> float | None:
    """Return an age for JSON: null also if there was no heartbeat."""
    return None if value.heartbeat_age in (None, inf) else _rounded(value.heartbeat_age)


def _heading(vehicle: VehicleStatus) -> float | None:
    return None if vehicle.yaw is None else _rounded(round(degrees(vehicle.yaw), 4) % 360.0)


def _rounded(value: float | None) -> float | None:
    """Return a number rounded to 4 decimals, without the noise of a float32."""
    return None if value is None else round(value, 4)


TASK: Parts = {
    "id": (attrgetter("id"), INTEGER),
    "vehicle": (attrgetter("vehicle"), INTEGER),
    "what": (what_of, TEXT),
    "label": (_given("label"), or_null(TEXT)),
    "command": (attrgetter("command"), INTEGER),
    "state": (state_of, words([state.name.lower() for state in TaskState])),
    "reason": (
        lambda status: status.reason.name.lower() if status.reason else None,
        or_null(REASON),
    ),
    "why": (
        lambda status: end_of(status) or None,
        or_null(TEXT, "why it is in its state, in words"),
    ),
    "priority": (attrgetter("priority"), INTEGER),
    "after": (_given("after"), or_null(INTEGER)),
    "every": (
        _of_type("every", int),
        or_null(INTEGER, "it repeats: s from one start to the next"),
    ),
    "cron": (
        _of_type("every", str),
        or_null(TEXT, "it repeats: a cron expression, perhaps with a time zone, else UTC"),
    ),
    "series": (attrgetter("series"), or_null(INTEGER, "id of the first run of its series")),
    "position": (attrgetter("position"), or_null(INTEGER, "number of tasks that run before it")),
    "progress": (attrgetter("progress"), or_null(NUMBER, "0 to 1")),
    "left": (
        lambda status: _rounded(left(status)[0]),
        or_null(NUMBER, "how much of it is left"),
    ),
    "left_unit": (
        lambda status: left(status)[1],
        or_null(TEXT, "unit of that: m, deg, s or items"),
    ),
    "item": (attrgetter("item"), INTEGER),
    "items": (attrgetter("items"), INTEGER),
    "time_to_start": (_number("time_to_start"), SECONDS),
    "time_to_finish": (_number("time_to_finish"), SECONDS),
    "execution_time": (_number("execution_time"), SECONDS),
    "nonce": (_given("nonce"), or_null(INTEGER)),
    "submitter": (
        attrgetter("submitter"),
        said(TEXT, "system and component id of who submitted it"),
    ),
    "version": (attrgetter("version"), INTEGER),
    "halt_epoch": (
        attrgetter("halt_epoch"),
        said(INTEGER, "the present one of its rover, to be sent with a release; 0: not known"),
    ),
    "ended_ago": (_number("ended_ago"), SECONDS),
    "ended_at": (_ended_at, or_null(TEXT, "ISO 8601")),
}
QUEUE: Parts = {
    "vehicle": (attrgetter("vehicle"), INTEGER),
    "running": (attrgetter("running"), or_null(INTEGER, "id of the running task")),
    "next": (attrgetter("next"), or_null(INTEGER, "id of the task that runs next")),
    "paused": (
        lambda queue: None if queue.paused is None else queue.paused.name.lower(),
        or_null(REASON, "why it is paused; null: it is not"),
    ),
    "halt_epoch": (
        attrgetter("halt_epoch"),
        said(INTEGER, "grows with each event that halts the rover"),
    ),
    "heartbeat_age": (_age, or_null(NUMBER, "s since the rover's heartbeat")),
    "gateway": (_given("gateway"), or_null(TEXT, "gateway of a fleet that has the rover")),
    "shares_id": (
        attrgetter("shares_id"),
        said(FLAG, "another rover has the same system id; it is ignored"),
    ),
    "waiting_count": (attrgetter("waiting_count"), said(INTEGER, "number of waiting tasks")),
    "capacity": (
        attrgetter("capacity"),
        said(INTEGER, "number of waiting tasks that there may be"),
    ),
    "counts": (
        lambda queue: {state.name.lower(): count for state, count in queue.counts.items()},
        {
            "type": "object",
            "description": "number of tasks in each state",
            "additionalProperties": INTEGER,
        },
    ),
    "current": (
        lambda queue: None if queue.current is None else task_json(queue.current),
        or_null(ref("Task")),
    ),
    "waiting": (
        lambda queue: [
            task_json(each) | {"why": why or None}
            for each, why in zip(queue.waiting, waits_of(queue).values(), strict=True)
        ],
        said(listed(ref("Task")), "in the order in which they run"),
    ),
}
VEHICLE: Parts = {
    "vehicle": (attrgetter("id"), said(INTEGER, "system id of the rover")),
    "kind": (attrgetter("kind"), said(TEXT, "ardupilot, px4, other or unknown")),
    "mode": (attrgetter("mode"), TEXT),
    "armed": (attrgetter("armed"), or_null(FLAG)),
    "heard": (attrgetter("is_heard"), said(FLAG, "its heartbeats arrive")),
    "heartbeat_age": (_age, SECONDS),
    "north": (_number("north"), or_null(NUMBER, "m north of its local origin")),
    "east": (_number("east"), or_null(NUMBER, "m east of it")),
    "heading": (_heading, or_null(NUMBER, "deg clockwise from north")),
    "speed": (_number("speed"), or_null(NUMBER, "m/s")),
    "latitude": (attrgetter("latitude"), or_null(NUMBER, "deg")),
    "longitude": (attrgetter("longitude"), or_null(NUMBER, "deg")),
    "position_age": (_number("position_age"), or_null(NUMBER, "s since its position arrived")),
    "battery": (attrgetter("battery"), or_null(NUMBER, "0 to 1")),
    "voltage": (attrgetter("voltage"), or_null(NUMBER, "V")),
    "ready": (attrgetter("is_ready"), or_null(FLAG, "its checks before arming pass")),
    "server_component": (attrgetter("server_component"), INTEGER),
}
TIMING: Parts = {
    "rate": (_number("rate"), said(NUMBER, "Hz")),
    "count": (attrgetter("count"), INTEGER),
    "p50": (_number("p50"), SECONDS),
    "p99": (_number("p99"), SECONDS),
    "max": (_number("max"), SECONDS),
    "late": (attrgetter("late"), INTEGER),
}


def task_json(status: TaskStatus) -> Form:
    return form_of(TASK, status)


def queue_json(queue: QueueStatus) -> Form:
    return form_of(QUEUE, queue)


def vehicle_json(vehicle: VehicleStatus) -> Form:
    return form_of(VEHICLE, vehicle)


def timing_json(timing: TaskTiming | None) -> Form | None:
    """Return the timing as JSON, in seconds; null if it is unknown."""
    return None if timing is None else form_of(TIMING, timing)
