"""What the operations of the API work on."""

import asyncio
from dataclasses import dataclass, field
from typing import Any

from mav_tasks.client.aio import Client
from mav_tasks.errors import StoreError
from mav_tasks.web.identity import Identity
from mav_tasks.web.journal import Journal
from mav_tasks.web.live import Live
from mav_tasks.web.problems import Problem
from mav_tasks.web.sessions import Sessions
from mav_tasks.web.tiles import Tiles
from mav_tasks.web.tokens import Tokens

#: what a submitter may do to its own tasks
WITH_OWN = frozenset({"cancel", "modify", "release"})
MOST_OWNERS = 20_000


@dataclass(slots=True)
class Services:
    """``owners``: the name of the token that submitted a task here. ``journal``: None: no store."""

    client: Client
    live: Live
    tokens: Tokens
    sessions: Sessions
    instance: str
    server: str
    journal: Journal | None = None
    tiles: Tiles | None = None
    owners: dict[int, str] = field(default_factory=dict)

    def own(self, task: int, identity: Identity) -> None:
        """Note who submitted a task."""
        self.owners[task] = identity.name
        while len(self.owners) > MOST_OWNERS:
            del self.owners[next(iter(self.owners))]

    async def entries(
        self, *, task: int | None, vehicle: int | None = None, after: int = 0, limit: int
    ) -> list[dict[str, Any]]:
        """Return events of the journal; raise Problem if it cannot be read."""
        assert self.journal is not None, "the operation has looked"
        try:
            return await asyncio.to_thread(
                self.journal.entries, task=task, vehicle=vehicle, after=after, limit=limit
            )
        except StoreError as error:
            raise Problem(503, "The journal cannot be read", str(error)) from error

    def check_may(self, what: str, task: int, identity: Identity) -> None:
        """Raise Problem unless somebody may do this to a task."""
        is_own = self.owners.get(task) == identity.name
        if what in identity.may:
            return
        if is_own and identity.role == "submitter" and what in WITH_OWN:
            return
        words = f"{identity.name} has the role {identity.role}, which may not {what} task {task}"
        raise Problem(403, "Not allowed", words, reason="not_allowed")
