"""A MAVLink task server for ground rovers, and its client library.

This module exports the public API. Each name imports its module when it is first used::

    from mav_tasks import Client, Move
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    __version__: str
    from mav_tasks.basics.errors import ClientError as ClientError
    from mav_tasks.basics.errors import MavTasksError as MavTasksError
    from mav_tasks.basics.errors import NoAnswer as NoAnswer
    from mav_tasks.basics.errors import NoSuchVehicle as NoSuchVehicle
    from mav_tasks.basics.errors import Refused as Refused
    from mav_tasks.basics.errors import TaskFailed as TaskFailed
    from mav_tasks.basics.errors import UsageError as UsageError
    from mav_tasks.client.aio import Client as Client
    from mav_tasks.client.handle import Task as Task
    from mav_tasks.client.sync import SyncClient as SyncClient
    from mav_tasks.client.sync import SyncTask as SyncTask
    from mav_tasks.client.values import QueueStatus as QueueStatus
    from mav_tasks.client.values import TaskStatus as TaskStatus
    from mav_tasks.client.values import TaskTiming as TaskTiming
    from mav_tasks.client.values import Text as Text
    from mav_tasks.client.values import VehicleStatus as VehicleStatus
    from mav_tasks.kinds import Act as Act
    from mav_tasks.kinds import Drive as Drive
    from mav_tasks.kinds import Face as Face
    from mav_tasks.kinds import GlobalPlace as GlobalPlace
    from mav_tasks.kinds import GoTo as GoTo
    from mav_tasks.kinds import LocalPlace as LocalPlace
    from mav_tasks.kinds import Move as Move
    from mav_tasks.kinds import Rotate as Rotate
    from mav_tasks.kinds import Wait as Wait
    from mav_tasks.mavlink.signing import Key as Key
    from mav_tasks.plans import read_plan as read_plan
    from mav_tasks.plans import write_plan as write_plan
    from mav_tasks.tasks.lifecycle import TaskReason as TaskReason
    from mav_tasks.tasks.lifecycle import TaskState as TaskState

_HOMES = {
    "mav_tasks.client.aio": "Client",
    "mav_tasks.client.handle": "Task",
    "mav_tasks.client.sync": "SyncClient SyncTask",
    "mav_tasks.client.values": "QueueStatus TaskStatus TaskTiming Text VehicleStatus",
    "mav_tasks.basics.errors": (
        "ClientError MavTasksError NoAnswer NoSuchVehicle Refused TaskFailed UsageError"
    ),
    "mav_tasks.mavlink.signing": "Key",
    "mav_tasks.plans": "read_plan write_plan",
    "mav_tasks.kinds": "Act Drive Face GlobalPlace GoTo LocalPlace Move Rotate Wait",
    "mav_tasks.tasks.lifecycle": "TaskReason TaskState",
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names.split()}

__all__ = sorted(_HOME_OF)  # noqa: PLE0605  # all of them are strings


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version  # noqa: PLC0415

        return version("mav-tasks")
    home = _HOME_OF.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(home), name)


def __dir__() -> list[str]:
    return __all__
