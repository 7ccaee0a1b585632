"""Lets every in-memory server of this process keep a record; run inside the other revision.

It uses that revision's own recorder, so that its records are what that revision wrote. In virtual
time a thread of its own could not keep up: what is noted is written when a record is closed.
"""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mav_tasks.engine.inputs import KeysChanged
from mav_tasks.in_memory import InMemoryServer
from mav_tasks.recording import decisions
from mav_tasks.settings import Settings

SIZE = 1 << 34  # bytes; no record of a test is as long
ROOM = 1 << 40  # bytes that wait to be written: without a limit


class AtTheEnd:
    """In place of the thread: writes when it is closed, in whoever closes it."""

    def __init__(self, _name: str, *, write: Callable[[], None], end: Callable[[], None]) -> None:
        self._write = write
        self._end = end

    def start(self) -> None:
        """There is nothing to begin."""

    def close(self) -> None:
        """Write all."""
        self._write()
        self._end()


class Recorders:
    """The open records of this process; ``close`` says in an index whose they were."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._open: list[tuple[Any, dict[str, str]]] = []
        self._index = folder / f"index-{os.getpid()}.jsonl"

    def install(self) -> None:
        """From now on each InMemoryServer is recorded."""
        setattr(decisions, "WritingThread", AtTheEnd)  # noqa: B010 - a name that it imports
        original = InMemoryServer.__init__

        def recorded(server: InMemoryServer, net: Any, **given: Any) -> None:
            witness = self._witness(given)
            witnesses = (*given.pop("witnesses", ()), witness)
            original(server, net, witnesses=witnesses, **given)

        setattr(InMemoryServer, "__init__", recorded)  # noqa: B010 - of another signature

    def close(self, whose: str) -> None:
        """End the records that are open; ``whose``: the test, or the life."""
        for witness, secrets in self._open:
            witness.close()
            line = {"record": witness.path.name, "whose": whose, "secrets": secrets}
            with self._index.open("a", encoding="utf-8") as index:
                index.write(json.dumps(line) + "\n")
        self._open.clear()

    def _witness(self, given: dict[str, Any]) -> Any:
        settings = given.get("settings") or Settings()
        witness = decisions.Decisions(
            self._folder,
            settings,
            given.get("restored"),
            now=given.get("now", 0.0),
            size=SIZE,
            most_waiting=ROOM,
        )
        secrets: dict[str, str] = {}
        took_in = witness.took_in

        def look(item: Any, *, now: float) -> None:
            if isinstance(item, KeysChanged):  # a record has no secrets; these are of tests
                for key in (key for key in item.keys if key.secret):
                    secrets[f"{key.name} {key.fingerprint}"] = key.secret.hex()
            took_in(item, now=now)

        witness.took_in = look  # type: ignore[method-assign]
        self._open.append((witness, secrets))
        return witness
