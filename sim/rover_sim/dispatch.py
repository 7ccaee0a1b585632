"""Handlers by message id: the part of the autopilot that takes each message."""

from collections.abc import Callable
from typing import Any

from mav_tasks.mavlink.address import Address

Handler = Callable[[Any, Address, float], None]
"""Takes a message of the one kind that it stands under in its table, its sender, and now."""
