"""The durable journal. ``mav_tasks.store.sqlite`` is imported by whoever needs a disk."""

from mav_tasks.store.base import HaltNotKept, Kept, NotKept, Outcome, Store
from mav_tasks.store.memory import MemoryStore

__all__ = ["HaltNotKept", "Kept", "MemoryStore", "NotKept", "Outcome", "Store"]
