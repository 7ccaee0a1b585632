"""The halt epoch in requests that may let a rover move: dialects/README.md, "Halt epoch".

A command carries the epoch modulo 2^24. The task server takes 0 for "no epoch" and does not compare
it. So the API refuses an epoch that would be sent as 0.
"""

from collections.abc import Mapping
from typing import Any

from mav_tasks.client.aio import EPOCHS
from mav_tasks.web.problems import invalid


def seen_epoch(body: Mapping[str, Any]) -> int:
    """Return the epoch of a request. Raise Problem if it would be sent as "no epoch"."""
    epoch: int = body["epoch"]
    if epoch % EPOCHS == 0:
        raise invalid(f"epoch {epoch}: read the queue again, and send its halt_epoch")
    return epoch
