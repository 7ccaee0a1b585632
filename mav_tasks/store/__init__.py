"""The durable journal of events. ``open_store`` opens each kind of store, by its place."""

from mav_tasks.store.base import Evicted, Outcome, Store, Which
from mav_tasks.store.memory import MemoryStore
from mav_tasks.store.opening import kind_of, open_store

__all__ = [
    "Evicted",
    "MemoryStore",
    "Outcome",
    "Store",
    "Which",
    "kind_of",
    "open_store",
]
