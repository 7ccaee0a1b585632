"""The objects that the operations of the API share."""

import asyncio
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from mav_tasks.client.aio import Client
from mav_tasks.errors import StoreError
from mav_tasks.tasks.goal import GoTo, Plan
from mav_tasks.web.goal_places import places_of_goals
from mav_tasks.web.identity import Identity
from mav_tasks.web.journal import Journal
from mav_tasks.web.live import Live
from mav_tasks.web.problems import Problem
from mav_tasks.web.records import Records
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
    records: Records | None = None
    owners: dict[int, str] = field(default_factory=dict)
    #: one reader of the journal at a time: several would take the interpreter from the event loop
    _reading: asyncio.Lock = field(default_factory=asyncio.Lock)
    _looking: set[asyncio.Task[None]] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.live.on_unknown_places = self._look_up_places

    def _look_up_places(self, task: int) -> None:
        """Read the places of another client's plan from the journal, in the background."""
        if self.journal is None:
            return
        looking = asyncio.get_running_loop().create_task(self._remember_places(self.journal, task))
        self._looking.add(looking)
        looking.add_done_callback(self._looking.discard)

    async def _remember_places(self, journal: Journal, task: int) -> None:
        with suppress(StoreError):  # the map lacks the places; nothing else does
            async with self._reading:
                goal = await asyncio.to_thread(journal.goal_of, task)
            steps = goal.steps if isinstance(goal, Plan) else ()
            places = places_of_goals([step for step in steps if isinstance(step, GoTo)])
            if places:
                self.live.remember_places(task, places)
                self.live.show_again(task)

    def own(self, task: int, identity: Identity) -> None:
        """Record the user who submitted a task."""
        self.owners[task] = identity.name
        while len(self.owners) > MOST_OWNERS:
            del self.owners[next(iter(self.owners))]

    async def entries(
        self, *, task: int | None, vehicle: int | None = None, after: int = 0, limit: int
    ) -> list[dict[str, Any]]:
        """Return events of the journal; raise Problem if it cannot be read."""
        assert self.journal is not None, "the operation has looked"
        try:
            async with self._reading:
                return await asyncio.to_thread(
                    self.journal.entries, task=task, vehicle=vehicle, after=after, limit=limit
                )
        except StoreError as error:
            raise Problem(503, "The journal cannot be read", str(error)) from error

    def is_still_known(self, session: str | None, headers: Mapping[str, str]) -> bool:
        """Return whether the session, or the token in the headers, of a request is still valid."""
        if session is not None:
            return self.sessions.token_of(session) is not None
        kind, _, text = headers.get("authorization", "").partition(" ")
        if kind.lower() != "bearer" or not text:
            return True
        return self.tokens.of_text(text.strip()) is not None

    def check_may(self, what: str, task: int, identity: Identity) -> None:
        """Raise Problem unless the user may do this to a task."""
        is_own = self.owners.get(task) == identity.name
        if what in identity.may:
            return
        if is_own and identity.role == "submitter" and what in WITH_OWN:
            return
        words = f"{identity.name} has the role {identity.role}, which may not {what} task {task}"
        raise Problem(403, "Not allowed", words, reason="not_allowed")
