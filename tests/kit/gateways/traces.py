"""Walks the objects that an engine refers to, and finds what still names a vehicle or its tasks."""

from collections.abc import Callable, Container, Iterator
from functools import partial
from types import BuiltinFunctionType, FunctionType, MethodType, ModuleType
from typing import Any

from mav_tasks.engine.clients.sender import Memory, Sender
from mav_tasks.engine.clients.signatures import Signatures
from mav_tasks.engine.inputs import Outgoing
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.tasks.task import Task
from mav_tasks.tasks.vehicle_tasks import VehicleTasks

#: what must be remembered although a vehicle is gone: the times of signatures, against replayed
#: packets, and what clients have said, so that a late copy of it counts as a copy
KEPT = (Signatures, Sender, Memory)
PLAIN = (str, bytes, bytearray, float, bool, type, ModuleType, BuiltinFunctionType)


def traces(root: object, vehicle: int, tasks: Container[int]) -> list[str]:
    """Return the path of each reference to a vehicle or to one of its tasks."""
    return [path for path, thing in objects(root) if _names(thing, vehicle, tasks)]


def count(root: object) -> int:
    """Return how many objects, numbers and texts included, are reached."""
    return sum(1 for _ in objects(root))


def objects(root: object) -> Iterator[tuple[str, Any]]:
    """Yield everything that is reached from an object, once, with a path to it."""
    seen: set[int] = set()
    left: list[tuple[str, Any]] = [("", root)]
    while left:
        path, thing = left.pop()
        if isinstance(thing, Outgoing):  # one of the last packets, by which echoes are known
            continue
        yield path, thing
        if isinstance(thing, (*PLAIN, int)) or thing is None or id(thing) in seen:
            continue
        seen.add(id(thing))
        if not isinstance(thing, KEPT):
            left += [(f"{path}{name}", each) for name, each in _parts(thing)]


def _names(thing: object, vehicle: int, tasks: Container[int]) -> bool:
    match thing:
        case bool():
            return False
        case int():
            return thing == vehicle or thing in tasks
        case str():
            return thing.startswith(f"{vehicle} ")
        case Vehicle():
            return thing.system_id == vehicle
        case VehicleTasks() | Task():
            return thing.vehicle == vehicle
    return False


def _parts(thing: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(thing, dict):
        for number, (key, value) in enumerate(thing.items()):
            yield f".keys[{number}]", key
            yield f"[{key!r:.40}]", value
    elif isinstance(thing, partial):
        yield ".func", thing.func
        yield ".args", (thing.args, thing.keywords)
    elif isinstance(thing, MethodType):
        yield ".__self__", thing.__self__
    elif isinstance(thing, FunctionType):
        cells: tuple[Any, ...] = thing.__closure__ or ()
        yield ".closure", [cell.cell_contents for cell in cells]
    else:
        with_items: Callable[..., Iterator[Any]] | None = getattr(type(thing), "__iter__", None)
        if isinstance(thing, (list, tuple, set, frozenset)) or type(thing).__name__ == "deque":
            assert with_items is not None
            for number, each in enumerate(thing):
                yield f"[{number}]", each
        for name, each in getattr(thing, "__dict__", {}).items():
            yield f".{name}", each
        for kind in type(thing).__mro__:
            slots = vars(kind).get("__slots__", ())
            for name in (slots,) if isinstance(slots, str) else slots:
                if hasattr(thing, name):
                    yield f".{name}", getattr(thing, name)
