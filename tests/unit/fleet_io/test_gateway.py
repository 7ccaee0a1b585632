"""A gateway that begins on a slow database."""

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread

import pytest

from mav_tasks import gateway
from mav_tasks.errors import StoreError
from mav_tasks.gateway import Gateway
from mav_tasks.settings import Gateway as GatewaySettings
from mav_tasks.settings import Retention
from tests.kit.postgres import PostgresServer, connected
from tests.kit.processes import wait_until

SLOW = "gateway a waits for its lease, 10 s at most: the fleet's database: another program has"


def opened(url: str) -> Gateway:
    return Gateway(url, GatewaySettings(name="a"), Retention(), system_id=250)


def ended(it: Gateway) -> None:
    it.store.close()
    it.close()


@contextmanager
def locked(url: str) -> Iterator[None]:
    """Let the table of leases answer nobody within the time for an answer, for a block."""
    with connected(url) as connection, connection.transaction():
        connection.execute("LOCK TABLE gateways IN ACCESS EXCLUSIVE MODE")
        yield


def test_it_says_what_it_waits_for_and_begins_when_the_database_answers(
    postgres: PostgresServer, caplog: pytest.LogCaptureFixture
) -> None:
    url = postgres.new_database()
    ended(opened(url))
    begun: list[Gateway] = []
    waiting = Thread(target=lambda: begun.append(opened(url)))
    with caplog.at_level(logging.WARNING):
        with locked(url):
            waiting.start()
            wait_until(lambda: SLOW in caplog.text, within=10)
            later = time.monotonic() + 0.5  # further attempts fail, too
            wait_until(lambda: time.monotonic() > later, within=5)
        waiting.join()
        list(begun[0].take())
        ended(begun[0])
    told = [record.getMessage() for record in caplog.records]
    assert len(told) == 2, told  # what it waited for is said once
    assert told[1] == "gateway a reaches the fleet's database again"


def test_in_the_end_it_says_why_it_does_not_begin(
    postgres: PostgresServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = postgres.new_database()
    ended(opened(url))
    monkeypatch.setattr(gateway, "JOIN_LIMIT", 1.0)
    with locked(url), pytest.raises(StoreError) as told:
        opened(url)
    words = "another program has locked its tables (canceling statement due to lock timeout)"
    assert str(told.value) == f"gateway a: no lease within 1 s: the fleet's database: {words}"
