"""Bounds on a server's memory: the size of every container, found by walking its objects."""

from collections import deque
from collections.abc import Iterator, Sized
from typing import Any

#: entries; other bounds are below
MOST = 1_000
#: by the name of the attribute; each bound has its own constant
LARGER = {
    "_finished": 10_000,
    "_heap": 200,  # start times, for as many tasks as there are here
    "_tasks": 12_000,
    "_last_event": 12_000,
    "_next": 1_100,  # sources of packets, see SequenceKeeper
    "_offset": 1_100,
    "_sent": 1_024,  # packets to vehicles, by which their echoes are known
    "_last": 8_000,  # streams: about 30 messages for each possible component of a vehicle
}


class Violation(AssertionError):
    """A rule was broken."""


#: where tasks are kept, whose number is bounded
TASKS = ("_registry", "_fleet", "deduplicator")
LEAVES = (str, bytes, int, float, bool, type(None))
CONTAINERS = (list, dict, set, frozenset, deque, tuple)


def too_large(root: object) -> Iterator[str]:
    """Yield the containers that exceed their bounds, with their paths."""
    for path, container in containers(root):
        name = path.rpartition(".")[2]
        if len(container) > LARGER.get(name, MOST):
            yield f"{path} holds {len(container)}"


def entries(root: object) -> int:
    """Return the total number of entries in all containers, except those for tasks."""
    found = containers(root)
    return sum(len(each) for path, each in found if not any(name in path for name in TASKS))


def containers(root: object) -> Iterator[tuple[str, Sized]]:
    """Return every container that our objects hold, with its path."""
    return ((path, each) for path, each in reachable(root) if isinstance(each, CONTAINERS))


def reachable(root: object) -> Iterator[tuple[str, Any]]:
    """Yield every object that our objects and their containers hold, once each, with its path."""
    seen: set[int] = set()
    waiting: list[tuple[str, Any]] = [(type(root).__name__, root)]
    while waiting:
        path, value = waiting.pop()
        if id(value) in seen or isinstance(value, type):
            continue
        seen.add(id(value))
        yield path, value
        if isinstance(value, LEAVES):
            continue
        if isinstance(value, CONTAINERS):
            inner = [*value.keys(), *value.values()] if isinstance(value, dict) else value
            waiting += [(f"{path}[]", each) for each in inner]
        elif type(value).__module__.startswith("mav_tasks"):
            waiting += [(f"{path}.{name}", each) for name, each in _attributes(value)]


def _attributes(value: object) -> Iterator[tuple[str, Any]]:
    yield from getattr(value, "__dict__", {}).items()
    for kind in type(value).__mro__:
        for name in getattr(kind, "__slots__", ()):
            if hasattr(value, name):
                yield name, getattr(value, name)
