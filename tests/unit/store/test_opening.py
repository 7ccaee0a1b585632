"""The registry of stores: what a place opens."""

import sys
from contextlib import closing
from pathlib import Path

import pytest

from mav_tasks.errors import StoreError
from mav_tasks.store import Which, memory, opening, sqlite
from mav_tasks.store.opening import KINDS, StoreKind, kind_of, open_store
from mav_tasks.store.postgres import store as postgres_store
from mav_tasks.tasks.events import VehicleSeen
from mav_tasks.tasks.server_events import ParameterSet
from tests.kit import third_store
from tests.unit.store.samples import wait_for

#: mypy checks each module against the interface
MODULES: list[StoreKind] = [memory, sqlite, postgres_store, third_store]
SEEN = VehicleSeen(1, "found", 1.0)
SET = ParameterSet("TSK_SPEED", 1.5, "255/190@x:1", 1.0)


@pytest.mark.parametrize(
    ("place", "module"),
    [
        ("", sqlite),
        ("a.sqlite3", sqlite),
        ("~/x:y", sqlite),
        (":memory:", memory),
        ("postgresql://host/fleet", postgres_store),
        ("postgres:///fleet", postgres_store),
    ],
)
def test_a_place_names_its_kind(place: str, module: StoreKind) -> None:
    assert kind_of(place) is module


def test_each_kind_is_in_the_registry() -> None:
    kinds = {f"mav_tasks.store.{name}" for name in ("memory", "sqlite", "postgres.store")}
    assert kinds == set(KINDS.values())


def test_a_url_of_an_unknown_kind_is_no_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(StoreError, match=r"^store other://host/db: unknown kind; expected a path"):
        open_store("other://host/db")
    assert list(tmp_path.iterdir()) == []


def test_a_kind_whose_package_is_missing_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in [name for name in sys.modules if name.startswith("mav_tasks.store.postgres")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "psycopg", None)  # an import of it fails
    with pytest.raises(StoreError) as told:
        open_store("postgresql://anna:secret@host/fleet")
    assert str(told.value) == (
        "store postgresql://anna@host/fleet: needs the package psycopg:"
        " run pip install '.[fleet]' in the folder of mav-tasks"
    )


def test_a_password_in_a_url_of_an_unknown_kind_is_not_told() -> None:
    with pytest.raises(StoreError) as told:
        open_store("mysql://anna:sec@ret@host/fleet?sslpassword=other")
    assert "mysql://anna@host/fleet: unknown kind" in str(told.value)


@pytest.mark.parametrize("place", [":memory:", "tasks.sqlite3", "shelf:tasks", "postgresql://"])
def test_every_kind_keeps_events_in_their_order(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    monkeypatch.chdir(tmp_path)
    if place == "postgresql://":
        place = request.getfixturevalue("postgres").new_database()
    monkeypatch.setitem(KINDS, "shelf:", "tests.kit.third_store")
    kind = kind_of(place)
    assert kind.read_parameters(place) == {}
    with closing(open_store(place)) as store:
        restored = store.load()
        assert restored is None or restored.tasks == ()
        store.append([SEEN])
        store.append([SET])
        wait_for(store, through=2)
        events = [event for _, event in store.journal()]
        assert [type(event) for event in events] == [VehicleSeen, ParameterSet]
    if place == opening.IN_MEMORY:
        with pytest.raises(StoreError, match="no journal"):
            kind.open_journal(place, Which())
        return
    assert kind.read_parameters(store.place) == {"TSK_SPEED": 1.5}
    with closing(kind.open_journal(store.place, Which(vehicle=1))) as journal:
        assert [number for number, _ in journal.take(offset=0.0)] == [1]
    with closing(open_store(store.place)) as again:
        restored = again.load()
        assert restored is not None
        assert restored.parameters == {"TSK_SPEED": 1.5}
