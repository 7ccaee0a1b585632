"""Another kind of store, ``shelf:FOLDER``. It has the methods of ``Store`` and no others."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from mav_tasks.settings import Retention
from mav_tasks.store import Outcome, Which, sqlite
from mav_tasks.store.base import JournalReader
from mav_tasks.tasks.events import Event
from mav_tasks.tasks.restored import Restored

SCHEME = "shelf:"


class Shelf:
    """Implements ``Store``."""

    def __init__(self, folder: Path, inner: sqlite.SqliteStore) -> None:
        self.name = f"shelf {folder.name}"
        self.place = f"{SCHEME}{folder.absolute()}"
        self._inner = inner

    def load(self) -> Restored:
        return self._inner.load()

    def journal(self) -> Iterator[tuple[int, Event]]:
        return self._inner.journal()

    def append(self, events: Sequence[Event]) -> None:
        self._inner.append(events)

    def take_outcomes(self) -> list[Outcome]:
        return self._inner.take_outcomes()

    def fileno(self) -> int | None:
        return self._inner.fileno()

    def close(self) -> None:
        self._inner.close()


def open_store(place: str, wall_offset: Callable[[], float], retention: Retention) -> Shelf:
    """Open a folder."""
    return Shelf(_folder(place), sqlite.open_store(_file(place), wall_offset, retention))


def open_journal(place: str, which: Which) -> JournalReader:
    """Open the journal of a folder."""
    return sqlite.open_journal(_file(place), which)


def read_parameters(place: str) -> dict[str, float]:
    """Return the parameters in a folder."""
    return sqlite.read_parameters(_file(place))


def _folder(place: str) -> Path:
    return Path(place.removeprefix(SCHEME))


def _file(place: str) -> str:
    return str(_folder(place) / "tasks")
