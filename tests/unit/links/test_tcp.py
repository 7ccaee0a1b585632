"""TCP links on real loopback sockets with ports that the system chooses."""

import resource
import select
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from mav_tasks.errors import LinkOpenError
from mav_tasks.links import tcp_out
from mav_tasks.links.attempts import RETRY
from mav_tasks.links.base import Peer, PeerChange, PeerState, StreamLink
from mav_tasks.links.link_limits import TO_CLIENTS, TO_VEHICLES, LinkLimits
from mav_tasks.links.tcp_in import TcpInLink, TcpInUrl
from mav_tasks.links.tcp_out import TcpOutLink, TcpOutUrl
from mav_tasks.links.url import parse_url
from tests.kit.clock import Clock

#: what a person reads, and what helps
IN_USE = (
    "Address already in use: end the program that has it (ss -lntup names it), or choose another"
)
HOST = "127.0.0.1"
PACKET = b"a packet"
LIMIT = 10.0  # s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr("mav_tasks.links.tcp.boot_time", made)
    monkeypatch.setattr(tcp_out, "monotonic", made)
    return made


@pytest.fixture
def listening() -> Iterator[TcpInLink]:
    link = TcpInLink(TcpInUrl("tcpin", HOST, 0), limits=TO_CLIENTS)
    yield link
    link.close()


@pytest.fixture
def server() -> Iterator[socket.socket]:
    """Somebody who listens."""
    with socket.create_server((HOST, 0)) as sock:
        sock.settimeout(LIMIT)
        yield sock


def dial(link: TcpInLink) -> socket.socket:
    return socket.create_connection((HOST, link.port), LIMIT)


class Watched:
    """A link and all that it has given."""

    def __init__(self, link: StreamLink) -> None:
        self.link = link
        self.pieces: list[tuple[Peer, bytes]] = []
        self.changes: list[PeerChange] = []

    def until(self, condition: Callable[[], object], *, tends: bool = True) -> None:
        """Do what a runner does until the condition holds."""
        end = time.monotonic() + LIMIT
        while not condition():
            assert time.monotonic() < end, (self.pieces, self.changes)
            select.select([self.link.fileno()], [], [], 0.01)
            self.pieces += self.link.receive(64)
            if tends:
                self.link.poll()
            self.changes += self.link.take_changes()

    @property
    def states(self) -> list[PeerState]:
        """What the engine is told."""
        for_the_log = PeerState.HEARD, PeerState.REFUSED
        return [each.state for each in self.changes if each.state not in for_the_log]

    def heard(self, peer: Peer) -> bytes:
        return b"".join(data for who, data in self.pieces if who == peer)


def has_packet(data: bytes) -> bool:
    return PACKET in data


def read(sock: socket.socket, count: int) -> bytes:
    sock.settimeout(LIMIT)
    data = b""
    while len(data) < count:
        more = sock.recv(count - len(data))
        assert more, f"ended after {data!r}"
        data += more
    return data


def up(link: TcpInLink, count: int) -> tuple[Watched, list[socket.socket]]:
    """Connect so many clients; give them when the link knows of all."""
    watched = Watched(link)
    clients = [dial(link) for _ in range(count)]
    watched.until(lambda: watched.states.count(PeerState.UP) == count)
    return watched, clients


# listening


def test_it_is_a_stream_link(listening: TcpInLink) -> None:
    link: StreamLink = listening
    assert isinstance(link, StreamLink)
    assert (link.name, link.peers, link.is_local) == (f"tcpin:{HOST}:0", (), True)
    assert repr(link) == f"TcpInLink(tcpin:{HOST}:0, 0 connections)"


def test_each_connection_is_a_peer_and_is_answered(listening: TcpInLink) -> None:
    watched, (one, two) = up(listening, 2)
    one.sendall(b"from one")
    two.sendall(b"from two")
    watched.until(lambda: len(watched.pieces) == 2)
    assert watched.heard(one.getsockname()) == b"from one"
    assert watched.heard(two.getsockname()) == b"from two"
    for each in (one, two):
        listening.send(each.getsockname(), b"to %d" % each.getsockname()[1])
        expected = b"to %d" % each.getsockname()[1]
        assert read(each, len(expected)) == expected
        each.close()


def test_who_comes_and_goes_is_told_in_order_and_in_words(listening: TcpInLink) -> None:
    watched, (client,) = up(listening, 1)
    peer = client.getsockname()
    client.sendall(b"last words")
    client.close()
    watched.until(lambda: PeerState.DOWN in watched.states)
    assert watched.heard(peer) == b"last words"
    name = f"{HOST}:{peer[1]}"
    assert watched.changes == [
        PeerChange(peer, PeerState.UP),
        PeerChange(peer, PeerState.HEARD, f"{name} connected"),
        PeerChange(peer, PeerState.DOWN, f"{name} disconnected: closed by the other end"),
    ]


def test_one_that_resets_its_connection_is_gone(listening: TcpInLink) -> None:
    watched, (client,) = up(listening, 1)
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    client.close()
    watched.until(lambda: PeerState.DOWN in watched.states)
    assert watched.changes[-1].words.endswith("disconnected: Connection reset by peer")


def test_what_is_sent_to_who_is_gone_is_lost_and_said_by_nobody(listening: TcpInLink) -> None:
    listening.send((HOST, 9), b"anybody?")
    watched, (client,) = up(listening, 1)
    peer = client.getsockname()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    client.close()
    for _ in range(3):  # before the link was read, as in the middle of a turn
        listening.send(peer, b"still there?")
    watched.until(lambda: PeerState.DOWN in watched.states)
    listening.send(peer, b"still there?")
    assert listening.lost >= 2
    assert watched.states == [PeerState.UP, PeerState.DOWN]


def test_a_piece_is_no_longer_than_a_packet_and_all_are_served_in_turn(
    listening: TcpInLink,
) -> None:
    watched, (one, two) = up(listening, 2)
    one.sendall(bytes(20_000))
    two.sendall(b"hello")
    watched.until(lambda: len(watched.heard(one.getsockname())) == 20_000)
    assert max(len(data) for _, data in watched.pieces) <= 280
    assert two.getsockname() in [peer for peer, _ in watched.pieces[:64]]
    for each in (one, two):
        each.close()


def test_one_that_comes_again_from_the_same_place_does_so_after_it_has_gone(
    listening: TcpInLink,
) -> None:
    """As a box with a fixed port does, all of it before the link is read again."""
    watched, (client,) = up(listening, 1)
    peer = client.getsockname()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    client.close()
    with socket.socket() as again:
        again.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        again.bind(peer)
        again.connect((HOST, listening.port))
        again.sendall(b"again")
        end, told = time.monotonic() + LIMIT, list[list[PeerState]]()
        while watched.heard(peer) != b"again" and time.monotonic() < end:
            select.select([listening.fileno()], [], [], LIMIT)
            watched.pieces += listening.receive(64)
            told.append([change.state for change in listening.take_changes()])
    # the engine is told of one reading's comings before its goings
    assert told[:2] == [[PeerState.DOWN], [PeerState.UP]]


@pytest.fixture
def small() -> Iterator[TcpInLink]:
    """A link for three connections, and guests for 0.2 s."""
    limits = replace(TO_CLIENTS, connections=3, unheard=0.2)
    link = TcpInLink(TcpInUrl("tcpin", HOST, 0), limits=limits)
    yield link
    link.close()


def is_open(sock: socket.socket) -> bool:
    sock.settimeout(0.0)
    try:
        return sock.recv(1) != b""
    except BlockingIOError:
        return True
    except ConnectionError:
        return False


def test_who_sends_nothing_valid_gives_way_the_oldest_first(small: TcpInLink) -> None:
    small.watch(lambda _peer: False, has_packet=has_packet, is_signed=False)
    watched, silent = up(small, 3)
    for _ in range(50):  # far more than there is room for, and nobody is refused
        late = dial(small)
        late.sendall(PACKET)
        watched.until(lambda late=late: late.getsockname() in _up_at(watched))  # type: ignore[misc]
        silent.append(late)
    watched.until(lambda: small.refused == 50)
    assert [is_open(each) for each in silent] == [False] * 50 + [True] * 3
    words = {change.words for change in watched.changes if change.state is PeerState.DOWN}
    assert f"{HOST}: a connection ended without a valid packet: the link is full" in words
    assert len(watched.changes) > 100
    assert len({change.words for change in watched.changes}) < 50  # the log counts the same ones
    for client in silent:
        client.close()


def _up_at(watched: Watched) -> set[Peer]:
    return {change.peer for change in watched.changes if change.state is PeerState.UP}


def test_an_address_with_few_connections_loses_none_to_one_with_many(small: TcpInLink) -> None:
    small.watch(lambda _peer: False, has_packet=has_packet, is_signed=False)
    watched = Watched(small)
    with socket.socket() as other:
        other.bind(("127.0.0.2", 0))
        other.connect((HOST, small.port))
        watched.until(lambda: watched.states == [PeerState.UP])
        crowd = [dial(small) for _ in range(20)]
        for each in crowd[10:]:
            each.sendall(PACKET)
        watched.until(lambda: watched.states.count(PeerState.UP) == 13)
        assert is_open(other)
        for each in crowd:
            each.close()


def test_who_speaks_is_heard_at_once_among_strangers_who_do_not(small: TcpInLink) -> None:
    """In a few turns, and before the next ``poll``: so is one who listens, of another address."""
    small.watch(lambda _peer: False, has_packet=has_packet, is_signed=False)
    watched, strangers = Watched(small), list[socket.socket]()
    for number in range(300):
        strangers.append(dial(small))
        if number % 2:
            strangers[-1].sendall(PACKET[:-1])
    with socket.socket() as listener, dial(small) as late:
        listener.bind(("127.0.0.2", 0))
        listener.connect((HOST, small.port))
        late.sendall(PACKET)
        for _ in range(10):
            watched.pieces += small.receive(64)
            watched.changes += small.take_changes()
        assert watched.heard(late.getsockname()) == PACKET
        assert listener.getsockname() in _up_at(watched)
        assert len(watched.states) < 20  # the engine knows nothing of the others
        strangers[-1].sendall(PACKET[-1:])
        watched.until(lambda: watched.heard(strangers[-1].getsockname()) == PACKET)
    for each in strangers:
        each.close()


def test_who_waits_without_a_word_gets_a_place_that_is_free_and_at_most_so_many_wait() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (256, hard))
    link = TcpInLink(TcpInUrl("tcpin", HOST, 0), limits=replace(TO_CLIENTS, connections=3))
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    link.watch(lambda _peer: False, has_packet=has_packet, is_signed=False)
    watched, first = up(link, 3)
    waiting = [dial(link) for _ in range(100)]
    watched.until(lambda: link.refused == 36)
    assert [is_open(each) for each in waiting] == [False] * 36 + [True] * 64
    first[0].close()
    watched.until(lambda: waiting[36].getsockname() in _up_at(watched))
    assert len(watched.states) == 5
    waiting[40].sendall(bytes(300))
    watched.until(lambda: watched.changes[-1].words.endswith("packet: bytes without a packet"))
    waiting[41].close()
    watched.until(lambda: watched.changes[-1].words.endswith("packet: closed by the other end"))
    link.close()
    assert not any(map(is_open, waiting[42:]))
    for each in first + waiting:
        each.close()


@pytest.mark.parametrize("is_signed", [True, False])
def test_who_is_silent_on_a_link_for_signed_packets_is_closed(
    small: TcpInLink, *, is_signed: bool
) -> None:
    """On others it may listen: anybody could send a valid packet there."""
    heard = set[Peer]()
    small.watch(heard.__contains__, has_packet=has_packet, is_signed=is_signed)
    watched, (silent, valid) = up(small, 2)
    heard.add(valid.getsockname())
    end = time.monotonic() + 0.5
    watched.until(lambda: time.monotonic() > end)
    assert is_open(valid)
    assert is_open(silent) is not is_signed
    for each in (silent, valid):
        each.close()


def test_beyond_the_limit_there_is_a_place_for_a_short_time_also_for_a_stop(
    small: TcpInLink,
) -> None:
    """All places are taken by clients that are heard."""
    small.watch(lambda _peer: True, has_packet=has_packet, is_signed=False)
    watched, clients = up(small, 3)
    for number in range(30):
        with dial(small) as late:
            late.sendall(PACKET)
            peer = late.getsockname()
            watched.until(lambda peer=peer: watched.heard(peer) == PACKET)  # type: ignore[misc]
            if number % 2:
                clients.append(late.dup())  # stays
    watched.until(lambda: small.refused == 15)
    assert [is_open(each) for each in clients] == [True] * 3 + [False] * 15
    clients.append(dial(small))  # and says nothing
    watched.until(lambda: watched.changes[-1].state is PeerState.REFUSED)
    assert watched.changes[-1].words.endswith("without a valid packet: 0.2 s are over")
    for client in clients:
        client.close()


@pytest.mark.parametrize("limits", [TO_VEHICLES, TO_CLIENTS])
def test_a_connection_sends_at_once_and_notices_when_nobody_is_there(limits: LinkLimits) -> None:
    listening = TcpInLink(TcpInUrl("tcpin", HOST, 0), limits=limits)
    _, (client,) = up(listening, 1)
    (connection,) = listening._by_peer.values()
    option = connection.socket.getsockopt
    assert option(socket.IPPROTO_TCP, socket.TCP_NODELAY)
    assert option(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
    if hasattr(socket, "TCP_USER_TIMEOUT"):
        assert option(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == limits.give_up * 1e3
    client.close()
    listening.close()


def test_without_descriptors_it_waits_for_some(
    listening: TcpInLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Exhausted:
        def __init__(self, sock: socket.socket) -> None:
            self.fileno, self.close = sock.fileno, sock.close

        def accept(self) -> None:
            raise OSError(24, "Too many open files")

    real = listening._socket
    watched = Watched(listening)
    with dial(listening) as client:
        monkeypatch.setattr(listening, "_socket", Exhausted(real))
        assert select.select([listening.fileno()], [], [], LIMIT)[0]
        listening.receive(64)
        assert not select.select([listening.fileno()], [], [], 0.0)[0]  # is not called for nothing
        monkeypatch.setattr(listening, "_socket", real)
        watched.until(lambda: watched.states == [PeerState.UP])
        assert watched.changes[0].peer == client.getsockname()


def test_a_port_in_use_is_one_clear_error(listening: TcpInLink) -> None:
    with pytest.raises(LinkOpenError) as error:
        TcpInLink(TcpInUrl("tcpin", HOST, listening.port), limits=TO_CLIENTS)
    words = f"link tcpin:{HOST}:{listening.port} cannot be opened: {IN_USE}"
    assert str(error.value) == words


@pytest.mark.parametrize("kind", ["tcpin", "tcp"])
def test_a_host_that_is_none_is_one_clear_error(kind: str) -> None:
    with pytest.raises(LinkOpenError, match=rf"^link {kind}:no host:1 cannot be opened: "):
        parse_url(f"{kind}:no host:1").open(limits=TO_CLIENTS)


# a slow reader


def test_a_slow_reader_delays_nobody_and_gets_whole_packets_the_newest_last(
    listening: TcpInLink, clock: Clock
) -> None:
    watched, (slow, quick) = up(listening, 2)
    sent = 0
    while listening.lost <= 2_000:
        listening.send(slow.getsockname(), sent.to_bytes(4, "big") + bytes(196))
        sent += 1
        clock.now += 0.001
        if sent % 500 == 1:
            listening.send(quick.getsockname(), b"hello")
            assert read(quick, 5) == b"hello"
        assert sent < 60_000
    listening.poll()  # before the system has sent some of what it had taken
    watched.changes += listening.take_changes()
    assert watched.changes[-1] == PeerChange(slow.getsockname(), PeerState.CONGESTED)
    connection = listening._by_peer[slow.getsockname()]
    assert connection.queue.size <= (1 << 16) + 200  # and the rest of one that was begun
    numbers: list[int] = []
    while not numbers or numbers[-1] != sent - 1:
        watched.until(lambda: True)
        listening.receive(64)
        packet = read(slow, 200)
        assert packet[4:] == bytes(196)
        numbers.append(int.from_bytes(packet[:4], "big"))
    assert numbers == sorted(set(numbers))
    assert len(numbers) + listening.lost == sent
    watched.until(lambda: PeerState.CLEAR in watched.states)
    for each in (slow, quick):
        each.close()


def test_towards_a_vehicle_nothing_old_is_delivered_later(
    server: socket.socket, clock: Clock
) -> None:
    """Its connection stalls; the newest setpoint comes next after what the system had taken."""
    link = TcpOutLink(TcpOutUrl("tcp", HOST, server.getsockname()[1]), limits=TO_VEHICLES)
    server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2_048)
    watched = Watched(link)
    watched.until(lambda: watched.states == [PeerState.UP])
    rover, _ = server.accept()
    for number in range(20_000):
        link.send(link._peer, number.to_bytes(4, "big") + bytes(61))
        clock.now += 0.05
    taken = 0
    numbers: list[int] = []
    while not numbers or numbers[-1] != 19_999:
        link.receive(64)
        numbers.append(int.from_bytes(read(rover, 65)[:4], "big"))
        taken += 1
    gap = next(n for n in range(taken - 1) if numbers[n + 1] != numbers[n] + 1)
    assert numbers[gap + 1 :] == list(range(19_996, 20_000)) or numbers[gap + 2 :] == list(
        range(19_996, 20_000)
    )
    rover.close()
    link.close()


# dialling


def test_a_dialling_link_has_one_peer_that_comes(server: socket.socket) -> None:
    port = server.getsockname()[1]
    link = TcpOutLink(TcpOutUrl("tcp", HOST, port), limits=TO_VEHICLES)
    watched = Watched(link)
    watched.until(lambda: watched.changes)
    other, _ = server.accept()
    assert watched.changes == [PeerChange((HOST, port), PeerState.UP, "is up")]
    assert (link.peers, link.is_local, repr(link)) == (
        (),
        True,
        f"TcpOutLink(tcp:{HOST}:{port}, up)",
    )
    link.send((HOST, port), b"hello")
    assert read(other, 5) == b"hello"
    other.sendall(b"answer")
    watched.until(lambda: watched.heard((HOST, port)) == b"answer")
    assert other.getpeername()[1] != port
    other.close()
    link.close()


def test_it_waits_for_the_other_end_and_dials_again_when_it_is_lost(clock: Clock) -> None:
    with socket.create_server((HOST, 0)) as reserved:
        port = reserved.getsockname()[1]
    link = TcpOutLink(TcpOutUrl("tcp", HOST, port), limits=TO_VEHICLES)
    watched = Watched(link)
    for _ in range(3):
        watched.until(lambda: link._dialling is None and watched.changes)
        clock.now += RETRY
        link.poll()
    link.send((HOST, port), b"lost")
    words = "is not available yet: Connection refused; trying again every second"
    assert [change.words for change in watched.changes] == [words]
    for expected in ("is up", "is back"):
        with socket.create_server((HOST, port)) as server:
            server.settimeout(LIMIT)
            clock.now += RETRY
            watched.until(lambda: watched.states[-1] is PeerState.UP)
            assert watched.changes[-1].words == expected
            other, _ = server.accept()
            other.close()
            watched.until(lambda: watched.states[-1] is PeerState.DOWN)
        lost = "lost: closed by the other end; trying again every second"
        assert watched.changes[-1].words == lost
    assert len(watched.changes) == 5
    assert link.lost == 1
    link.close()


def test_it_dials_no_more_than_once_a_second(server: socket.socket, clock: Clock) -> None:
    link = TcpOutLink(TcpOutUrl("tcp", HOST, server.getsockname()[1]), limits=TO_VEHICLES)
    watched = Watched(link)
    watched.until(lambda: watched.changes)
    server.accept()[0].close()
    watched.until(lambda: PeerState.DOWN in watched.states)
    for _ in range(10):
        link.poll()
        assert link._dialling is None
        assert not link._by_peer
        clock.now += RETRY / 11
    clock.now += RETRY / 11
    watched.until(lambda: watched.states[-1] is PeerState.UP)
    server.accept()[0].close()
    link.close()


def test_one_that_never_answers_is_given_up_and_dialled_again(
    clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = TcpOutLink(TcpOutUrl("tcp", HOST, 9), limits=TO_VEHICLES)
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as full:
        full.bind((HOST, 0))
        full.listen(0)
        backlog = []
        for _ in range(4):  # from now on nobody is answered
            sock = socket.socket()
            sock.setblocking(False)
            sock.connect_ex(full.getsockname())
            backlog.append(sock)
        link._addresses = [(socket.AF_INET, full.getsockname())]
        link.poll()
        clock.now += tcp_out.CONNECT_LIMIT - 0.1
        link.poll()
        assert link.take_changes() == []
        clock.now += 0.2
        link.poll()
        (change,) = link.take_changes()
        assert change.words == "is not available yet: no answer; trying again every second"
        for sock in backlog:
            sock.close()
    link.close()


def test_what_was_sent_just_before_the_end_arrives(server: socket.socket) -> None:
    """Even with something unread, for which the system would otherwise reset the connection."""
    link = TcpOutLink(TcpOutUrl("tcp", HOST, server.getsockname()[1]), limits=TO_VEHICLES)
    watched = Watched(link)
    watched.until(lambda: watched.changes)
    other, _ = server.accept()
    other.sendall(b"unread" * 100)
    assert select.select([link.fileno()], [], [], LIMIT)[0]
    link.send(link._peer, b"stop")
    link.close()
    assert read(other, 4) == b"stop"
    other.close()


@pytest.mark.parametrize(("host", "local"), [(HOST, True), ("localhost", True), ("0.0.0.0", False)])
def test_a_link_beyond_this_machine_is_not_local(host: str, local: bool) -> None:
    link = TcpInLink(TcpInUrl("tcpin", host, 0), limits=TO_CLIENTS)
    assert link.is_local is local
    link.close()
