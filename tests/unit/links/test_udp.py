"""UDP links on real loopback sockets with ports that the system chooses."""

import select
import socket
import time
from collections.abc import Iterator
from math import inf
from typing import cast

import pytest

from mav_tasks.errors import LinkOpenError
from mav_tasks.links.base import Link, Peer
from mav_tasks.links.link_limits import TO_CLIENTS, TO_VEHICLES
from mav_tasks.links.udp import COUNT, FIRST, UdpLink, UdpUrl, port_for
from mav_tasks.links.url import parse_url

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
def listening() -> Iterator[UdpLink]:
    link = UdpLink(UdpUrl("udpin", HOST, 0))
    yield link
    link.close()


def address_of(link: UdpLink) -> tuple[str, int]:
    with socket.socket(fileno=socket.dup(link.fileno())) as same:
        return cast(tuple[str, int], same.getsockname())


def wait_for(link: UdpLink) -> None:
    assert select.select([link.fileno()], [], [], 5.0)[0], "nothing came"


def received(link: UdpLink, count: int) -> list[tuple[Peer, bytes]]:
    datagrams: list[tuple[Peer, bytes]] = []
    while len(datagrams) < count:
        wait_for(link)
        datagrams += link.receive(64)
    return datagrams


def test_it_is_a_link(listening: UdpLink) -> None:
    link: Link = listening
    assert (link.name, link.peers, link.is_local) == (f"udpin:{HOST}:0", (), True)


def test_a_datagram_comes_with_its_sender_and_can_be_answered(
    listening: UdpLink, other: socket.socket
) -> None:
    other.sendto(b"hello", address_of(listening))
    ((peer, data),) = received(listening, 1)
    assert (peer, data) == (other.getsockname(), b"hello")
    listening.send(peer, b"answer")
    assert other.recvfrom(100) == (b"answer", address_of(listening))


def test_datagrams_come_in_order_and_no_more_than_asked_for(
    listening: UdpLink, other: socket.socket
) -> None:
    for number in range(5):
        other.sendto(bytes([number]), address_of(listening))
    wait_for(listening)
    first = listening.receive(2)
    rest = received(listening, 5 - len(first))
    assert len(first) == 2
    assert [data for _, data in first + rest] == [bytes([n]) for n in range(5)]


def test_without_datagrams_it_gives_none_at_once(listening: UdpLink) -> None:
    assert listening.receive(64) == []
    assert listening.lost == 0


def test_a_dialling_link_knows_its_peer_beforehand(other: socket.socket) -> None:
    link = UdpLink(UdpUrl("udpout", HOST, other.getsockname()[1]))
    assert link.peers == (other.getsockname(),)
    link.send(link.peers[0], b"first word")
    data, sender = other.recvfrom(100)
    assert data == b"first word"
    other.sendto(b"answer", sender)
    assert received(link, 1) == [(other.getsockname(), b"answer")]
    link.close()


def test_peers_that_are_pushed_to_are_known_beforehand(other: socket.socket) -> None:
    port = other.getsockname()[1]
    link = UdpLink(UdpUrl("udpin", HOST, 0), push=(("localhost", port),))
    assert link.peers == ((HOST, port),)
    link.close()


@pytest.mark.parametrize(
    ("push", "local"), [((), True), (((HOST, 9),), True), ((("192.0.2.1", 9),), False)]
)
def test_a_link_is_local_if_all_that_it_speaks_to_are(
    push: tuple[tuple[str, int], ...], local: bool
) -> None:
    link = UdpLink(UdpUrl("udpin", HOST, 0), push=push)
    assert link.is_local is local
    link.close()


def test_a_port_in_use_is_one_clear_error(other: socket.socket) -> None:
    port = other.getsockname()[1]
    with pytest.raises(LinkOpenError) as error:
        UdpLink(UdpUrl("udpin", HOST, port))
    assert str(error.value) == f"link udpin:{HOST}:{port} cannot be opened: {IN_USE}"


def test_a_host_that_is_none_is_one_clear_error() -> None:
    with pytest.raises(LinkOpenError, match=r"^link udpin:no host:1 cannot be opened: "):
        UdpLink(UdpUrl("udpin", "no host", 1))


def test_a_peer_that_is_gone_costs_nothing_but_the_datagram(listening: UdpLink) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as gone:
        gone.bind((HOST, 0))
        nobody = gone.getsockname()
    for _ in range(3):
        listening.send(nobody, b"anybody?")
        listening.receive(64)


def test_a_datagram_that_the_system_does_not_take_is_counted(listening: UdpLink) -> None:
    listening.send((HOST, 9), b"x" * 70_000)
    assert listening.lost == 1


def test_it_says_what_it_is(listening: UdpLink) -> None:
    assert repr(listening) == f"UdpLink(udpin:{HOST}:0)"


@pytest.mark.parametrize("family", [socket.AF_INET, socket.AF_INET6])
def test_a_link_that_dials_this_machine_hears_no_other(
    family: socket.AddressFamily, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The system would bind its socket to every address, where anybody may send."""
    made: list[socket.socket] = []
    kind = socket.socket

    def noted(*arguments: int) -> socket.socket:
        made.append(kind(*arguments))
        return made[-1]

    monkeypatch.setattr(socket, "socket", noted)
    host = HOST if family == socket.AF_INET else "::1"
    link = UdpLink(UdpUrl("udpout", host, 9))
    link.send(link.peers[0], b"hello")
    assert made[0].getsockname()[0] == host
    link.close()


def test_one_that_speaks_to_others_too_hears_them() -> None:
    link = UdpLink(UdpUrl("udpout", HOST, 9), push=(("192.0.2.1", 9),))
    assert not link.is_local
    link.close()


def dialling(port: int, *, local: int | None = None) -> UdpLink:
    option = "" if local is None else f"?local={local}"
    link = parse_url(f"udpout:{HOST}:{port}{option}").open(limits=TO_VEHICLES)
    assert isinstance(link, UdpLink)
    return link


def test_a_rover_is_dialled_from_the_same_port_each_time(other: socket.socket) -> None:
    """It answers its first sender only, as PX4's simulation does."""
    answered: tuple[str, int] | None = None
    for _ in range(3):  # a probe, a server, the server again
        link = dialling(other.getsockname()[1])
        link.send(link.peers[0], b"hello")
        data, sender = other.recvfrom(100)
        answered = answered or sender
        other.sendto(data, answered)
        wait_for(link)
        assert [data for _, data in link.receive(10)] == [b"hello"]
        assert link.note == ""
        link.close()


def test_rovers_side_by_side_have_ports_of_their_own() -> None:
    ports = [port_for(HOST, port) for port in range(14580, 14680)]
    assert len(set(ports)) == 100
    assert all(FIRST <= port < FIRST + COUNT for port in ports)


def test_where_that_port_is_taken_it_is_said_and_another_one_is_used(other: socket.socket) -> None:
    port = other.getsockname()[1]
    first, second = dialling(port), dialling(port)
    assert address_of(second) != address_of(first)
    assert second.note.startswith(f"local port {address_of(first)[1]} is in use")
    second.send(second.peers[0], b"hello")
    assert other.recvfrom(100) == (b"hello", address_of(second))
    first.close()
    second.close()


def test_a_port_that_the_url_names_is_the_one_or_none(other: socket.socket) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind((HOST, 0))
        free = sock.getsockname()[1]
        with pytest.raises(LinkOpenError):
            dialling(other.getsockname()[1], local=free)
    link = dialling(other.getsockname()[1], local=free)
    assert address_of(link) == (HOST, free)
    link.close()


def test_clients_dial_from_any_port(other: socket.socket) -> None:
    url = UdpUrl("udpout", HOST, other.getsockname()[1])
    several = [url.open(limits=TO_CLIENTS) for _ in range(3)]
    assert len({address_of(cast(UdpLink, link)) for link in several}) == 3
    for link in several:
        link.close()


def test_each_datagram_says_when_it_arrived(listening: UdpLink, other: socket.socket) -> None:
    began = time.time()
    other.sendto(b"old", address_of(listening))
    wait_for(listening)
    sent = time.monotonic()
    while time.monotonic() < sent + 0.2:
        select.select([], [], [], 0.2)
    other.sendto(b"new", address_of(listening))
    datagrams, stamps = listening.receive_stamped(64)
    assert [data for _, data in datagrams] == [b"old", b"new"]
    assert began - 0.01 < stamps[0] < stamps[1] - 0.1 < time.time()


def test_a_datagram_without_a_stamp_may_have_arrived_at_any_time(
    monkeypatch: pytest.MonkeyPatch, other: socket.socket
) -> None:
    monkeypatch.setattr("mav_tasks.links.udp.ask_for_stamps", lambda sock: None)
    link = UdpLink(UdpUrl("udpin", HOST, 0))
    other.sendto(b"word", address_of(link))
    wait_for(link)
    assert link.receive_stamped(64) == ([(other.getsockname(), b"word")], [-inf])
    link.close()
