"""A mission that starts when its vehicle is armed: PX4's way to start one, in two steps.

A ground station asks for the mission mode, waits until a heartbeat shows it, and arms. If it arms
first, the mode alone starts the mission, and there is nothing to remember.
"""

from math import inf
from typing import NamedTuple

from mav_tasks.engine.clients.rights import Rights
from mav_tasks.tasks.halts import Halts
from mav_tasks.tasks.task import Submitter

WAITS = 10.0  # s in which the arming must come


class Marker(NamedTuple):
    """The client that asked for it."""

    submitter: Submitter
    rights: Rights
    plan_id: int  # as clients knew it at that time


class StartMark:
    """Whether a vehicle's mission starts when it is armed."""

    def __init__(self, halts: Halts) -> None:
        self._halts = halts
        self._term = -1  # in which it was wanted
        self.marker: Marker | None = None  #: the last client that wanted it
        self._until = -inf

    def __repr__(self) -> str:
        return f"StartMark({self.marker}, until={self._until:.2f})"

    def put(self, marker: Marker, *, now: float) -> None:
        """Remember that a client wants it, and has not armed yet."""
        self.marker, self._term = marker, self._halts.term
        self._until = now + WAITS

    def is_put(self, *, now: float) -> bool:
        """Return whether a client still wants it, and nothing has halted the vehicle since."""
        is_of_now = self._term == self._halts.term
        return self.marker is not None and is_of_now and now < self._until

    def remove(self) -> None:
        """Forget it, because something else was requested since."""
        self.marker = None

    def take(self) -> Marker | None:
        """Return who wants the mission to start, and forget it: the vehicle is armed."""
        marker, self.marker = self.marker, None
        return marker
