"""The journal of a store, read page by page beside whoever writes it."""

import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from itertools import islice
from pathlib import Path

import pytest

from mav_tasks.basics.errors import StoreError
from mav_tasks.store import Store, Which, kind_of
from mav_tasks.store.base import JournalReader
from mav_tasks.tasks.events import Event, VehicleSeen
from tests.kit.databases import tables
from tests.unit.store.samples import OFFSET, cancelled, keep, loaded, opened, submitted, wait_for

PAGE = 500  # entries that are read at once


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "tasks.sqlite3"


@pytest.fixture
def store(place: str) -> Iterator[Store]:
    with opened(place) as it:
        yield it


def history(count: int) -> list[Event]:
    """Tasks submitted and cancelled, one after the other."""
    return [
        event for number in range(1, count + 1) for event in cancelled(number, at=10.0 + number)
    ]


def journal_of(place: str | Path, which: Which | None = None) -> JournalReader:
    return kind_of(str(place)).open_journal(str(place), which or Which())


def read(place: str | Path, which: Which | None = None) -> list[tuple[int, Event]]:
    with closing(journal_of(place, which)) as it:
        return list(it.take(offset=OFFSET))


@pytest.mark.parametrize("count", [0, 1, PAGE // 2, PAGE // 2 + 1, 2 * PAGE + 7])
def test_every_event_is_given_once_in_its_order(store: Store, place: str, count: int) -> None:
    events: list[Event] = [VehicleSeen(1, "found", 1.0), *history(count)]
    assert read(place) == []
    keep(store, *events)
    assert read(place) == list(enumerate(events, 1))


def test_what_comes_later_is_given_to_who_goes_on_reading(store: Store, place: str) -> None:
    first = history(3)
    then: list[Event] = [VehicleSeen(1, "found", 99.0), submitted(4)]
    keep(store, *first)
    with closing(journal_of(place)) as it:
        seen = it.version()
        assert [event for _, event in it.take(offset=OFFSET)] == first
        assert it.version() == seen
        store.append(then)
        wait_for(store, len(first) + 2)
        assert it.version() != seen
        assert list(it.take(offset=OFFSET)) == list(enumerate(then, len(first) + 1))
        assert list(it.take(offset=OFFSET)) == []


def test_some_of_it(store: Store, place: str) -> None:
    ours, theirs = history(4), VehicleSeen(2, "found", 50.0)
    keep(store, *ours, theirs)
    assert [event for _, event in read(place, Which(task=3))] == ours[4:6]
    assert [event for _, event in read(place, Which(vehicle=2))] == [theirs]
    assert [event for _, event in read(place, Which(vehicle=1))] == ours
    late = read(place, Which(since=OFFSET + 13.5))  # the third is submitted before, ends after it
    assert [event for _, event in late] == [*ours[5:], theirs]
    assert read(place, Which(task=3, vehicle=2)) == []
    numbered = list(enumerate([*ours, theirs], 1))
    assert [read(place, Which(after=number)) for number in (4, 9, 0)] == [
        numbered[4:],
        numbered[9:],
        numbered,
    ]


def test_a_reader_that_stays_keeps_nothing_from_the_writer(path: Path) -> None:
    with opened(path) as store:
        _stay(store, path)


def _stay(store: Store, path: Path) -> None:
    keep(store, *history(PAGE))
    with closing(journal_of(path)) as it, closing(sqlite3.connect(path)) as other:
        events = it.take(offset=OFFSET)
        assert len(list(islice(events, 10))) == 10  # the pager has no room for more
        store.append([VehicleSeen(1, "found", 99.0)])
        wait_for(store, 2 * PAGE + 1)
        busy, pages, done = other.execute("PRAGMA wal_checkpoint(FULL)").fetchone()
        assert (busy, pages) == (0, done)
        assert len(list(events)) == 2 * PAGE + 1 - 10


def test_reading_needs_no_lock_and_no_server(store: Store, place: str) -> None:
    keep(store, *history(3))
    assert len(read(place)) == 6
    store.close()
    assert len(read(place)) == 6
    with opened(place) as again:
        restored = loaded(again)
        assert restored.ended_well


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_store_is_read_where_nobody_may_write(path: Path) -> None:
    with opened(path) as store:
        keep(store, *history(3))
    path.parent.chmod(0o500)
    try:
        assert len(read(path)) == 6
    finally:
        path.parent.chmod(0o700)


def test_an_event_that_this_version_does_not_know_is_named(store: Store, place: str) -> None:
    keep(store, VehicleSeen(1, "found", 1.0))
    with tables(place) as connection:
        connection.execute("UPDATE journal SET kind = 'Later'")
    with pytest.raises(StoreError, match="this version does not know Later"):
        read(place)
