"""UDP links on real loopback sockets."""

import select
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from typing import cast

import pytest

from mav_tasks.basics.errors import LinkOpenError
from mav_tasks.links import TO_CLIENTS, TO_VEHICLES, LinkLimits, parse_url
from mav_tasks.links.base import CountingLink, Link, Peer, StampedLink
from tests.kit.processes import free_udp_ports, wait_until

#: what a person reads, and what helps
IN_USE = (
    "Address already in use: end the program that has it (ss -lntup names it), or choose another"
)
HOST = "127.0.0.1"


@pytest.fixture
def other() -> Iterator[socket.socket]:
    """Somebody else's socket."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind((HOST, 0))
        sock.settimeout(5.0)
        yield sock


@pytest.fixture
def listening() -> Iterator[Link]:
    with closing(opened(f"udpin:{HOST}:{free_udp_ports(1)[0]}")) as link:
        yield link


def opened(
    url: str, *, limits: LinkLimits = TO_VEHICLES, push: tuple[tuple[str, int], ...] = ()
) -> Link:
    return parse_url(url).open(limits=limits, push=push)


def address_of(link: Link) -> tuple[str, int]:
    with socket.socket(fileno=socket.dup(link.fileno())) as same:
        return cast(tuple[str, int], same.getsockname())


def wait_for(link: Link) -> None:
    assert select.select([link.fileno()], [], [], 5.0)[0], "nothing came"


def received(link: Link, count: int) -> list[tuple[Peer, bytes]]:
    datagrams: list[tuple[Peer, bytes]] = []
    while len(datagrams) < count:
        wait_for(link)
        datagrams += link.receive(64)
    return datagrams


def test_datagrams_come_in_order_with_their_sender_and_can_be_answered(
    listening: Link, other: socket.socket
) -> None:
    assert listening.receive(64) == []
    for number in range(5):
        other.sendto(bytes([number]), address_of(listening))
    wait_for(listening)
    first = listening.receive(2)
    rest = received(listening, 5 - len(first))
    assert len(first) == 2
    assert first + rest == [(other.getsockname(), bytes([n])) for n in range(5)]
    listening.send(first[0][0], b"answer")
    assert other.recvfrom(100) == (b"answer", address_of(listening))


def test_peers_that_are_dialled_or_pushed_to_are_known_beforehand(other: socket.socket) -> None:
    port = other.getsockname()[1]
    (free,) = free_udp_ports(1)
    pushing = opened(f"udpin:{HOST}:{free}", push=(("localhost", port),))
    dialling = opened(f"udpout:{HOST}:{port}")
    for link in (pushing, dialling):
        with closing(link):
            assert (link.peers, link.is_local) == (((HOST, port),), True)
            link.send(link.peers[0], b"first word")
            data, sender = other.recvfrom(100)
            other.sendto(data, sender)
            assert received(link, 1) == [(other.getsockname(), b"first word")]
    for far in (f"udpin:{HOST}:{free}", f"udpout:{HOST}:9"):
        with closing(opened(far, push=(("192.0.2.1", 9),))) as link:
            assert not link.is_local


def test_what_cannot_be_opened_is_one_clear_error(other: socket.socket) -> None:
    port = other.getsockname()[1]
    for url, words in (
        (f"udpin:{HOST}:{port}", IN_USE),
        (f"udpout:{HOST}:9?local={port}", IN_USE),
        ("udpin:no host:1", ""),
    ):
        with pytest.raises(LinkOpenError) as error:
            opened(url)
        assert str(error.value).startswith(f"link {url.partition('?')[0]} cannot be opened: ")
        assert str(error.value).endswith(words)


def test_a_datagram_that_is_not_taken_costs_nothing_but_itself(listening: Link) -> None:
    (nobody,) = free_udp_ports(1)
    for _ in range(3):
        listening.send((HOST, nobody), b"anybody?")
        listening.receive(64)
    assert isinstance(listening, CountingLink)
    assert listening.lost == 0
    listening.send((HOST, 9), b"x" * 70_000)
    assert listening.lost == 1


@pytest.mark.parametrize("host", [HOST, "[::1]"])
def test_a_link_that_dials_this_machine_hears_no_other(host: str) -> None:
    """The system would bind its socket to every address, where anybody may send."""
    with closing(opened(f"udpout:{host}:9")) as link:
        link.send(link.peers[0], b"hello")
        assert address_of(link)[0] == host.strip("[]")


def test_a_rover_is_dialled_from_the_same_port_each_time(other: socket.socket) -> None:
    """It answers its first sender only, as PX4's simulation does."""
    port = other.getsockname()[1]
    answered: tuple[str, int] | None = None
    for _ in range(3):  # a probe, a server, the server again
        with closing(opened(f"udpout:{HOST}:{port}")) as link:
            link.send(link.peers[0], b"hello")
            data, sender = other.recvfrom(100)
            answered = answered or sender
            other.sendto(data, answered)
            wait_for(link)
            assert [data for _, data in link.receive(10)] == [b"hello"]
            assert link.note == ""
    url = f"udpout:{HOST}:{port}"
    with closing(opened(url)) as first, closing(opened(url)) as second:  # the port is taken
        assert address_of(second) != address_of(first) == answered
        assert second.note.startswith(f"local port {address_of(first)[1]} is in use")
    (free,) = free_udp_ports(1)
    with closing(opened(f"udpout:{HOST}:{port}?local={free}")) as link:
        assert address_of(link) == (HOST, free)
    with ExitStack() as stack:  # clients, or rovers side by side
        links = [opened(f"udpout:{HOST}:{port}", limits=TO_CLIENTS) for _ in range(3)]
        links += [opened(f"udpout:{HOST}:{14_580 + number}") for number in range(20)]
        for link in links:
            stack.callback(link.close)
        assert len({address_of(link) for link in links}) == 23
        # a program beside this one may have one of their ports
        assert sum(bool(link.note) for link in links) < 3


def test_each_datagram_says_when_it_arrived(listening: Link, other: socket.socket) -> None:
    assert isinstance(listening, StampedLink)
    link = listening

    def is_stamped() -> bool:  # the kernel begins that a moment after it was asked to
        other.sendto(b"first", address_of(link))
        time.sleep(0.05)
        return link.receive_stamped(1)[1] < [time.time() - 0.04]

    wait_until(is_stamped, within=10, what="the kernel's stamps")
    began = time.time()
    other.sendto(b"old", address_of(link))
    time.sleep(0.2)
    other.sendto(b"new", address_of(link))
    datagrams, stamps = link.receive_stamped(64)
    assert [data for _, data in datagrams] == [b"old", b"new"]
    assert began - 0.01 < stamps[0] < stamps[1] - 0.1 < time.time()
