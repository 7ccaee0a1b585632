"""Tasks, queues and rovers as JSON: the form of the command line, the HTTP API and agents. Pure.

Angles are in degrees here. Unknown values are null.
"""

from datetime import datetime, timedelta
from math import degrees, inf
from typing import Any

from mav_tasks.client.descriptions import end_of, left, state_of, waits_of, what_of
from mav_tasks.client.values import QueueStatus, TaskStatus, TaskTiming, VehicleStatus


def task_json(status: TaskStatus) -> dict[str, Any]:
    """Return a task as JSON; unknown values are null."""
    amount, unit = left(status)
    return {
        "id": status.id,
        "vehicle": status.vehicle,
        "what": what_of(status),
        "label": status.label or None,
        "command": status.command,
        "state": state_of(status),
        "reason": status.reason.name.lower() if status.reason else None,
        "priority": status.priority,
        "after": status.after or None,
        "every": status.every if isinstance(status.every, int) else None,
        "cron": status.every if isinstance(status.every, str) else None,
        "series": status.series,
        "position": status.position,
        "progress": status.progress,
        "left": _rounded(amount),
        "left_unit": unit,
        "item": status.item,
        "items": status.items,
        "time_to_start": _rounded(status.time_to_start),
        "time_to_finish": _rounded(status.time_to_finish),
        "execution_time": _rounded(status.execution_time),
        "nonce": status.nonce or None,
        "submitter": status.submitter,
        "version": status.version,
    }


def history_json(status: TaskStatus, *, now: datetime) -> dict[str, Any]:
    """Return a finished task as JSON, with the time of its end."""
    ago = status.ended_ago
    ended_at = None if ago is None else now - timedelta(seconds=ago)
    return task_json(status) | {
        "why": end_of(status) or None,
        "ended_ago": _rounded(ago),
        "ended_at": None if ended_at is None else ended_at.isoformat(timespec="seconds"),
    }


def queue_json(queue: QueueStatus) -> dict[str, Any]:
    waits = waits_of(queue)
    return {
        "vehicle": queue.vehicle,
        "running": queue.running,
        "next": queue.next,
        "paused": None if queue.paused is None else queue.paused.name.lower(),
        "halt_epoch": queue.halt_epoch,
        "heartbeat_age": _age(queue.heartbeat_age),
        "gateway": queue.gateway or None,
        "shares_id": queue.shares_id,
        "waiting_count": queue.waiting_count,
        "capacity": queue.capacity,
        "counts": {state.name.lower(): count for state, count in queue.counts.items()},
        "current": None if queue.current is None else task_json(queue.current),
        "waiting": [task_json(each) | {"why": waits[each.id] or None} for each in queue.waiting],
    }


def vehicle_json(vehicle: VehicleStatus) -> dict[str, Any]:
    heading = None if vehicle.yaw is None else round(degrees(vehicle.yaw), 4) % 360.0
    return {
        "vehicle": vehicle.id,
        "kind": vehicle.kind,
        "mode": vehicle.mode,
        "armed": vehicle.armed,
        "heard": vehicle.is_heard,
        "heartbeat_age": _age(vehicle.heartbeat_age),
        "north": _rounded(vehicle.north),
        "east": _rounded(vehicle.east),
        "heading": _rounded(heading),
        "speed": _rounded(vehicle.speed),
        "latitude": vehicle.latitude,
        "longitude": vehicle.longitude,
        "position_age": _rounded(vehicle.position_age),
        "battery": vehicle.battery,
        "voltage": vehicle.voltage,
        "ready": vehicle.is_ready,
        "server_component": vehicle.server_component,
    }


def timing_json(timing: TaskTiming | None) -> dict[str, Any] | None:
    """Return the timing as JSON, in seconds; null if it is unknown."""
    if timing is None:
        return None
    names = ("rate", "count", "p50", "p99", "max", "late")
    return {name: _rounded(getattr(timing, name)) for name in names}


def _age(heartbeat_age: float | None) -> float | None:
    """Return an age for JSON: null also if there was no heartbeat."""
    return None if heartbeat_age in (None, inf) else _rounded(heartbeat_age)


def _rounded(value: float | None) -> float | None:
    """Return a number rounded to 4 decimals, without the noise of a float32."""
    return None if value is None else round(value, 4)
