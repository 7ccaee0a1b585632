"""The durable journal of events. Import ``mav_tasks.store.sqlite`` for the store on disk."""

from mav_tasks.store.base import HaltNotKept, Kept, NotKept, Outcome, Store
from mav_tasks.store.memory import MemoryStore

__all__ = ["HaltNotKept", "Kept", "MemoryStore", "NotKept", "Outcome", "Store"]
