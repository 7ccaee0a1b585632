"""Converts settings and restored state to JSON values and back, exactly.

Tasks have their own lines (``record_lines``): there may be a hundred thousand.
"""

from collections.abc import Mapping
from dataclasses import astuple, fields, is_dataclass
from typing import Any

from mav_tasks.config.settings import Settings, VehicleProfile
from mav_tasks.tasks.events import SignatureTime
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Task


def settings_of(values: Mapping[str, Any], kind: Any = Settings) -> Any:
    """Return settings from the values of ``asdict``, also by way of JSON.

    A missing value is the default; raise ValueError for an unknown name.
    """
    makers = {field.name: field.default_factory for field in fields(kind)}
    unknown = sorted(set(values) - set(makers))
    if unknown:
        raise ValueError(f"{kind.__name__}.{unknown[0]} is unknown to this version")
    return kind(**{name: _setting_of(value, makers[name]) for name, value in values.items()})


def _setting_of(value: Any, maker: Any) -> Any:
    if is_dataclass(maker):
        return settings_of(value, maker)
    if isinstance(value, list | tuple):  # of texts, or of profiles
        return tuple(settings_of(v, VehicleProfile) if isinstance(v, dict) else v for v in value)
    return value


def restored_to_json(restored: Restored) -> dict[str, Any]:
    """Return the JSON values of a Restored, with only the number of tasks; keep mappings' order."""
    return {
        "tasks": len(restored.tasks),
        "next_id": restored.next_id,
        "paused": [[vehicle, int(reason)] for vehicle, reason in restored.paused.items()],
        "uids": list(restored.uids.items()),
        "speeds": list(restored.speeds.items()),
        "halt_epochs": list(restored.halt_epochs.items()),
        "halted": [[vehicle, int(why), at] for vehicle, (why, at) in restored.halted.items()],
        "disarmed": sorted(restored.disarmed),
        "plans": [[*key, *plan] for key, plan in restored.plans.items()],
        "parameters": list(restored.parameters.items()),
        "signatures": [astuple(time) for time in restored.signatures],
        "signed_until": restored.signed_until,
        "ended_well": restored.ended_well,
        "idle": restored.idle,
        "wall_offset": restored.wall_offset,
        "gateway": restored.gateway,
        "signing_lead": restored.signing_lead,
    }


def restored_of(values: Mapping[str, Any], tasks: tuple[Task, ...]) -> Restored:
    """Return a Restored from JSON values; raise KeyError, TypeError or ValueError for others."""
    return Restored(
        tasks=tasks,
        next_id=values["next_id"],
        paused={vehicle: TaskReason(reason) for vehicle, reason in values["paused"]},
        uids=dict(values["uids"]),
        speeds=dict(values["speeds"]),
        halt_epochs=dict(values.get("halt_epochs", ())),
        halted={vehicle: (TaskReason(why), at) for vehicle, why, at in values.get("halted", ())},
        disarmed=frozenset(values.get("disarmed", ())),
        plans={
            (vehicle, kind): (plan_id, source) for vehicle, kind, plan_id, source in values["plans"]
        },
        parameters=dict(values["parameters"]),
        signatures=tuple(SignatureTime(*time) for time in values["signatures"]),
        signed_until=values["signed_until"],
        ended_well=values["ended_well"],
        idle=values["idle"],
        wall_offset=values["wall_offset"],
        gateway=values.get("gateway", ""),
        signing_lead=values.get("signing_lead", 0.0),
    )
