"""A gateway whose lease was ended begins again, whatever the fleet's database does meanwhile."""

import pytest

from mav_tasks import serve
from mav_tasks.errors import StoreError
from mav_tasks.runner import EVICTED
from mav_tasks.settings import Gateway, ServerSettings
from tests.kit.postgres import PostgresServer

FULL = "gateway a: no lease within 10 s: the fleet's database: the disk of the database is full"


def test_it_waits_until_the_database_can_be_written(
    postgres: PostgresServer,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """As after a fail-over to a replica, and then while the disk is full."""
    url = postgres.new_database()
    database = f"ALTER DATABASE {url.rpartition('/')[2]}"
    postgres.execute(f"{database} SET default_transaction_read_only = on")
    lives: list[int | StoreError] = [EVICTED, StoreError(FULL), StoreError(FULL), 0]
    pauses: list[float] = []

    def live(*_: object) -> int:
        code = lives.pop(0)
        if isinstance(code, StoreError):
            raise code
        return code

    def sleep(seconds: float) -> None:
        pauses.append(seconds)
        if len(pauses) == 3:
            postgres.execute(f"{database} RESET default_transaction_read_only")

    monkeypatch.setattr(serve, "_serve", live)
    monkeypatch.setattr("mav_tasks.serve.time.sleep", sleep)
    assert serve.serve(ServerSettings(store=url, gateway=Gateway(name="a"))) == 0
    assert pauses == [serve.AGAIN] * 5
    told = [line.split(maxsplit=2)[2] for line in capfd.readouterr().err.splitlines()]
    read_only = "it is read-only: ALTER DATABASE … RESET default_transaction_read_only"
    assert told == [
        "gateway a begins again, without rovers",
        f"store {url}: {read_only}, or use another server; trying again until it works",
        f"{FULL}; trying again until it works",
    ]


def test_a_first_start_ends_with_the_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> int:
        raise StoreError(FULL)

    monkeypatch.setattr(serve, "_serve", fail)
    with pytest.raises(StoreError):
        serve.serve(ServerSettings(gateway=Gateway(name="a")))
