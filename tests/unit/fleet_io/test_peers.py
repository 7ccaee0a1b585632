"""Pings between gateways, on real sockets: who is there, and who certainly is not any more."""

import selectors
import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager
from random import Random

import pytest

from mav_tasks.fleet_io import peers
from mav_tasks.fleet_io.endpoint import Endpoint
from mav_tasks.fleet_io.peers import Peers, Seen, Sign
from tests.kit.processes import wait_until

HOST, SECRET = "127.0.0.1", b"of the fleet"

pytestmark = pytest.mark.skipif(
    not hasattr(socket, "MSG_ERRQUEUE"), reason="only Linux tells which host has refused"
)


@contextmanager
def gateway(secret: bytes = SECRET, *, host: str = HOST) -> Iterator[Peers]:
    with selectors.DefaultSelector() as selector, closing(Peers(selector, host)) as it:
        it.begin(secret)
        yield it


def asked(it: Peers, other: Peers, *, epoch: int = 7, now: float = 1.0) -> list[Seen]:
    """Ask once, let the other one answer as gateway b of epoch 7, and return what was seen."""
    it.update({"b": Endpoint(epoch, HOST, other.port)})
    it.ask(now)
    assert other._selector.select(5.0), "the question"
    other.receive("b", 7, now=now)
    it._selector.select(0.05)
    return it.receive("a", 1, now=now + 0.1)


def test_an_answer_counts_from_the_moment_of_its_question() -> None:
    with gateway() as a, gateway() as b:
        assert asked(a, b) == [Seen("b", Sign.ANSWERED, 1.0)]


def test_another_secret_or_epoch_is_not_answered() -> None:
    with gateway() as a, gateway(b"another") as stranger, gateway() as b:
        assert asked(a, stranger) == []
        assert asked(a, b, epoch=6) == []


def test_an_answer_counts_once_and_only_for_its_question() -> None:
    with gateway() as a, closing(socket.socket(type=socket.SOCK_DGRAM)) as other:
        other.bind((HOST, 0))
        other.settimeout(5.0)
        a.update({"b": Endpoint(7, HOST, other.getsockname()[1])})
        a.ask(1.0)
        question, sender = other.recvfrom(1000)
        nonce = question[1:17]
        for name, epoch, number in (("b", 7, nonce), ("b", 7, nonce), ("b", 6, bytes(16))):
            other.sendto(a._datagram(b"!", number, epoch, name), sender)
        other.sendto(question, sender)  # its own words are no answer
        found = wait_until(lambda: a.receive("a", 1, now=1.1), within=5)
        assert found == [Seen("b", Sign.ANSWERED, 1.0)]
        assert a.receive("a", 1, now=1.2) == []


def test_who_has_ended_is_refused_by_its_host() -> None:
    with gateway() as a:
        with gateway() as b:
            assert asked(a, b) == [Seen("b", Sign.ANSWERED, 1.0)]

        def seen() -> list[Seen]:
            a.ask(2.0)
            a._selector.select(0.1)
            return a.receive("a", 1, now=3.0)

        found = wait_until(seen, within=5)
        assert found == [Seen("b", Sign.REFUSED, 3.0)]


def test_a_refusal_counts_only_from_the_host_itself() -> None:
    """A firewall on the way may refuse, too, while the process lives."""
    with gateway() as a, closing(peers._udp_socket(HOST)) as it:
        peer = peers._Peer(Endpoint(7, "192.0.2.1", 9), it)

        def told(
            *, origin: int = 2, kind: int = 3, code: int = 3, sender: str = "192.0.2.1"
        ) -> bool:
            error = peers._ERROR.pack(111, origin, kind, code, 0, 0, 0)
            address = b"\2\0\0\0" + socket.inet_aton(sender) + bytes(8)
            return peers._is_refusal(error + address, peer)

        assert told()
        assert not told(sender="192.0.2.254")
        assert not told(code=1)  # host unreachable
        assert not told(origin=1)  # this machine's own error
        assert not peers._is_refusal(b"", peer)
        assert a.port


def test_a_new_epoch_has_nothing_to_do_with_earlier_answers() -> None:
    with gateway() as a, gateway() as b:
        a.update({"b": Endpoint(7, HOST, b.port)})
        a.ask(1.0)
        assert b._selector.select(5.0)
        b.receive("b", 7, now=1.0)
        a.update({"b": Endpoint(8, HOST, b.port)})
        assert a.receive("a", 1, now=1.1) == []


def test_nothing_that_comes_raises() -> None:
    chance = Random(1)
    with gateway() as a, gateway() as b, closing(socket.socket(type=socket.SOCK_DGRAM)) as other:
        for _ in range(200):
            other.sendto(chance.randbytes(chance.randrange(80)), (HOST, b.port))
        short = b"?" + bytes(chance.randrange(5))
        other.sendto(short + b._tag(short), (HOST, b.port))
        a.update({"x": Endpoint(1, "no address", 1), "y": Endpoint(1, HOST, 70_000)})
        a.ask(1.0)
        for _ in range(10):
            assert b.receive("b", 7, now=1.0) == []
        assert asked(a, b) == [Seen("b", Sign.ANSWERED, 1.0)]
