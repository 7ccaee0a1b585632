"""A mission that begins when its vehicle is armed: PX4's way to start one, in two steps.

A ground station asks for the mission mode, waits until a heartbeat shows it, and arms. Armed first,
the mode alone starts it, and there is nothing to remember.
"""

from collections.abc import Hashable
from math import inf
from typing import NamedTuple

from mav_tasks.engine.clients.rights import Rights
from mav_tasks.tasks.task import Submitter

WAITS = 10.0  # s for the arming


class Marker(NamedTuple):
    """Who wants the mission to begin."""

    client: Hashable
    submitter: Submitter
    rights: Rights
    plan_id: int  # as clients knew it then


class StartMark:
    """Whether a vehicle's mission begins when it is armed."""

    def __init__(self) -> None:
        self.marker: Marker | None = None  #: who wants it, if anybody does
        self._until = -inf

    def __repr__(self) -> str:
        return f"StartMark({self.marker}, until={self._until:.2f})"

    def put(
        self,
        client: Hashable,
        submitter: Submitter,
        rights: Rights,
        *,
        plan_id: int,
        now: float,
    ) -> None:
        """A client wants it, and has not armed yet."""
        self.marker = Marker(client, submitter, rights, plan_id)
        self._until = now + WAITS

    def is_put(self, *, now: float) -> bool:
        """Whether somebody wants it still."""
        return self.marker is not None and now < self._until

    def remove(self) -> None:
        """Something else was wished for since."""
        self.marker = None

    def take(self) -> Marker | None:
        """The vehicle is armed: give who wanted the mission to begin then, once."""
        marker, self.marker = self.marker, None
        return marker
