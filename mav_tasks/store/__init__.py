"""The durable journal of events. ``open_store`` opens each kind of store, by its place."""

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
from mav_tasks.store.opening import kind_of, open_store

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
    "kind_of",
    "open_store",
]
