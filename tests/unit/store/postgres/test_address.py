"""URLs of databases: what they mean, what is shown of them, and what is refused."""

import pytest

from mav_tasks.errors import StoreError
from mav_tasks.store.place import without_password
from mav_tasks.store.postgres.address import parse


@pytest.mark.parametrize(
    ("url", "shown"),
    [
        ("postgresql://anna@host/fleet", None),
        ("postgresql://host:5433/fleet", None),
        ("postgres://anna:secret@host/fleet", "postgres://anna@host/fleet"),
        ("postgresql://anna:se?secret@host/fleet", "postgresql://anna@host/fleet"),
        ("postgresql://:secret@host/fleet", "postgresql://host/fleet"),
        ("postgresql://anna:s%40cr%2Fet@host/fleet", "postgresql://anna@host/fleet"),
        ("postgresql:///fleet?host=/run/postgresql", None),
        ("postgresql://anna@one,two:5433/fleet?target_session_attrs=any", None),
        ("postgresql://host/fleet?password=secret", "postgresql://host/fleet"),
        (
            "postgresql://host/fleet?sslpassword=secret&user=anna",
            "postgresql://host/fleet?user=anna",
        ),
        ("postgresql://[::1]:5432/fleet", None),
        ("postgresql:///?service=fleet", None),
    ],
)
def test_a_url_is_shown_without_its_password_and_finds_the_same_database(
    url: str, shown: str | None
) -> None:
    address = parse(url)
    assert address.shown == (shown or url)
    assert "secret" not in repr(address)
    again = parse(address.shown)
    secrets = {"password", "sslpassword"}
    assert again.parameters == {k: v for k, v in address.parameters.items() if k not in secrets}


def test_a_password_is_used() -> None:
    assert parse("postgresql://anna:s%40cret@host/fleet").parameters["password"] == "s@cret"


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("postgresql://host:no/fleet", "the port is a number"),
        ("postgresql://host:70000/fleet", "the port is a number"),
        ("postgresql://host/fleet?colour=red", 'invalid URI query parameter: "colour"'),
        ("postgresql://%zz/fleet", "invalid percent-encoded token"),
        ("postgresql://anna:se@cret@host/fleet", "write %40 for @"),
        ("postgresql://anna:se/cret@host/fleet", "write %40 for @"),
        ("postgresql://anna:cret%zz@host/fleet", "write %40 for @"),
    ],
)
def test_what_is_no_url_is_refused_in_one_line_without_its_password(url: str, words: str) -> None:
    with pytest.raises(StoreError) as told:
        parse(url)
    text = str(told.value)
    assert text.startswith("store postgresql://")
    assert words in text
    assert "cret" not in text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("place", "shown"),
    [
        ("tasks.sqlite3", "tasks.sqlite3"),
        ("~/odd:name@x/tasks", "~/odd:name@x/tasks"),
        (":memory:", ":memory:"),
        ("other://anna:secret@host/x", "other://anna@host/x"),
        ("other://host/x?a=1&password=secret&b=2", "other://host/x?a=1&b=2"),
    ],
)
def test_other_places_are_shown_as_they_are(place: str, shown: str) -> None:
    assert without_password(place) == shown
