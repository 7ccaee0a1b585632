"""The durable journal of events. ``mav_tasks.store.opening`` opens each kind of store."""

from mav_tasks.store.base import HaltNotKept, Kept, NotKept, Outcome, Store, Which
from mav_tasks.store.memory import MemoryStore

__all__ = ["HaltNotKept", "Kept", "MemoryStore", "NotKept", "Outcome", "Store", "Which"]
