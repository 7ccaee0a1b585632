"""Gateways that begin, and what they ask each other."""

import re
import selectors
import socket
from contextlib import closing

import pytest

from mav_tasks.basics.errors import StoreError
from mav_tasks.fleet.io.endpoint import Endpoint
from mav_tasks.fleet.io.keeper import Keeper
from mav_tasks.fleet.io.peers import Peers, Seen, Sign
from mav_tasks.store.postgres.address import parse
from tests.kit.postgres import PostgresServer, connected
from tests.kit.processes import wait_until

HOST = "127.0.0.1"
REFUSED = """a b 127.0.0.1: a name has up to 40 letters
a 127.0.0.1: the (database has not ended the lost session yet|gateway name a is in use)
b nowhere: fleet.address must be an IP address of this machine
b 192.0.2.1: fleet.address must be an IP address of this machine"""


def test_a_gateway_that_cannot_begin_or_not_yet_says_why(postgres: PostgresServer) -> None:
    address = parse(postgres.new_database())
    with closing(Keeper(address, "a", host=HOST)):
        for name, host, words in re.findall(r"(.*) (\S+): (.*)", REFUSED):
            with pytest.raises(StoreError, match=words):
                Keeper(address, name, host=host)
    with connected(address.shown) as other, other.transaction():
        other.execute("LOCK TABLE gateways IN ACCESS EXCLUSIVE MODE")
        with closing(Keeper(address, "c", host=HOST)) as late:
            assert "another program has locked its tables" in str(late.take())


def test_a_gateway_answers_its_fleet_and_nobody_else() -> None:
    with (
        selectors.DefaultSelector() as selector,
        closing(Peers(selector, HOST)) as a,
        closing(Peers(selector, HOST)) as b,
        socket.socket(type=socket.SOCK_DGRAM) as other,
    ):
        other.bind((HOST, 0))
        for it in (a, b):
            it.begin(b"of the fleet")
        ports = {"b": b.port, "other": other.getsockname()[1], "none": 70_000}
        a.update({name: Endpoint(7, HOST, port) for name, port in ports.items()})
        a.ask(1.0)
        question, sender = other.recvfrom(1000)
        for data in (b"no answer", *[question] * 70):
            other.sendto(data, sender)
            other.sendto(data, (HOST, b.port))
        found = wait_until(
            lambda: b.receive("b", 7, now=1.0) + a.receive("a", 1, now=1.1), within=5
        )
        assert found == [Seen("b", Sign.ANSWERED, 1.0)]
