"""The kinds of stores, by the beginning of a store's place: the text of ``--store``."""

import time
from collections.abc import Callable
from importlib import import_module
from typing import Protocol, cast

from mav_tasks.basics.clock import boot_time
from mav_tasks.basics.errors import StoreError
from mav_tasks.config.settings import Retention
from mav_tasks.store.base import JournalReader, Store, Which
from mav_tasks.store.place import without_password

IN_MEMORY = ":memory:"

#: the beginning of a place -> the module of that kind of store, which is imported when it is used
KINDS = {
    "": "mav_tasks.store.sqlite",  # a path; "": the file in the user's data folder
    IN_MEMORY: "mav_tasks.store.memory",
    "postgresql://": "mav_tasks.store.postgres.store",
    "postgres://": "mav_tasks.store.postgres.store",  # libpq takes both
}


class StoreKind(Protocol):
    """The interface of a module in KINDS. Each function raises StoreError if it cannot do it."""

    def open_store(
        self, place: str, wall_offset: Callable[[], float], retention: Retention, /
    ) -> Store:
        """Open a store for the one server that writes it; create it if it does not exist.

        ``wall_offset`` returns the current UTC minus ``boot_time``.
        """

    def open_journal(self, place: str, which: Which, /) -> JournalReader:
        """Open the journal of an existing store, which a server may be writing."""

    def read_parameters(self, place: str, /) -> dict[str, float]:
        """Return the parameters that clients have set, by name; {} if there is no store yet."""


def kind_of(place: str) -> StoreKind:
    """Return the kind of a store: the one in KINDS with the longest beginning that fits."""
    beginning = max(filter(place.startswith, KINDS), key=len)
    if not beginning and "://" in place:
        expected = f"a path, postgresql://USER@HOST/DATABASE, or {IN_MEMORY}"
        raise StoreError(f"store {without_password(place)}: unknown kind; expected {expected}")
    try:
        return cast(StoreKind, import_module(KINDS[beginning]))
    except StoreError as error:  # a package is not installed
        raise StoreError(f"store {without_password(place)}: {error}") from error


def open_store(place: str, retention: Retention | None = None) -> Store:
    """Open the store of a server; raise StoreError."""
    kind = kind_of(place)
    return kind.open_store(place, lambda: time.time() - boot_time(), retention or Retention())
