"""The durable journal of events. ``mav_tasks.store.opening`` opens each kind of store."""

from mav_tasks.store.base import (
    Evicted,
    HaltNotKept,
    HaltsKept,
    IdsGranted,
    Kept,
    NonceTaken,
    NotKept,
    Outcome,
    Store,
    TaskStates,
    VehiclesLoaded,
    Which,
)
from mav_tasks.store.memory import MemoryStore

__all__ = [
    "Evicted",
    "HaltNotKept",
    "HaltsKept",
    "IdsGranted",
    "Kept",
    "MemoryStore",
    "NonceTaken",
    "NotKept",
    "Outcome",
    "Store",
    "TaskStates",
    "VehiclesLoaded",
    "Which",
]
