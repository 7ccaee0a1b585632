"""Gateways that begin, what they ask each other, and what waits for their loops."""

import selectors
import socket
from contextlib import closing
from math import inf

import pytest

from mav_tasks.errors import StoreError
from mav_tasks.fleet.exchange import Arrived
from mav_tasks.fleet_io.endpoint import Endpoint
from mav_tasks.fleet_io.inbox import LIMIT, Inbox
from mav_tasks.fleet_io.keeper import Keeper, Trouble
from mav_tasks.fleet_io.peers import Peers, Seen, Sign
from mav_tasks.store.postgres.address import parse
from tests.kit.postgres import PostgresServer, connected
from tests.kit.processes import wait_until

HOST = "127.0.0.1"
REFUSED = f"""a b {HOST}: a name has up to 40 letters
a {HOST}: the database has not ended the lost session yet
b nowhere: fleet.address must be an IP address of this machine
b 192.0.2.1: fleet.address must be an IP address of this machine"""


def test_a_gateway_that_cannot_begin_or_not_yet_says_why(postgres: PostgresServer) -> None:
    address = parse(postgres.new_database())
    with closing(Keeper(address, "a", host=HOST)):
        for row in REFUSED.splitlines():
            asked, _, words = row.partition(": ")
            name, _, host = asked.rpartition(" ")
            with pytest.raises(StoreError, match=words):
                Keeper(address, name, host=host)
    with connected(address.shown) as other, other.transaction():
        other.execute("LOCK TABLE gateways IN ACCESS EXCLUSIVE MODE")
        with closing(Keeper(address, "c", host=HOST)) as late:
            (trouble,) = [each for each in late.take() if isinstance(each, Trouble)]
    assert "another program has locked its tables" in (trouble.words or "")


def test_a_gateway_answers_its_fleet_and_nobody_else() -> None:
    with (
        selectors.DefaultSelector() as selector,
        closing(Peers(selector, HOST)) as a,
        closing(Peers(selector, HOST)) as b,
        closing(socket.socket(type=socket.SOCK_DGRAM)) as other,
    ):
        other.bind((HOST, 0))
        for it in (a, b):
            it.begin(b"of the fleet")
        ports = {"b": b.port, "other": other.getsockname()[1], "none": 70_000}
        a.update({name: Endpoint(7, HOST, port) for name, port in ports.items()})
        for length in range(100):
            other.sendto(bytes(length), (HOST, b.port))
        a.ask(1.0)
        question, sender = other.recvfrom(1000)
        for data in (b"no answer", *[question] * 70):
            other.sendto(data, sender)
        seen: list[Seen] = []

        def has_seen() -> list[Seen]:
            assert b.receive("b", 7, now=1.0) == []
            seen.extend(a.receive("a", 1, now=1.1))
            return seen

        wait_until(has_seen, within=5)
        assert seen == [Seen("b", Sign.ANSWERED, 1.0)]


def test_what_comes_too_late_for_the_loop_or_is_too_much_is_dropped() -> None:
    inbox = Inbox()
    for payload, until in ((b"late", 11.0), *[(b"x", inf)] * LIMIT):
        inbox.put(Arrived("a", b"session", payload, at=10.0, waited=0.5, until=until))
    inbox.put(Trouble("away"))
    with selectors.DefaultSelector() as selector:
        selector.register(inbox.fileno() or 0, selectors.EVENT_READ)
        found = inbox.take(1, now=12.0)
        assert selector.select(0), "there is more"
        found += inbox.take(now=12.0)
        assert not selector.select(0)
    assert [getattr(each, "payload", each) for each in found] == [
        *[b"x"] * (LIMIT - 1),
        Trouble("away"),
    ]
    assert (inbox.late, inbox.unread) == (1, 1)
