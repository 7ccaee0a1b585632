"""TCP links on real loopback sockets with ports that the system chooses."""

import resource
import select
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from dataclasses import replace
from typing import Any

import pytest

from mav_tasks.basics.errors import LinkOpenError
from mav_tasks.links import TO_CLIENTS, TO_VEHICLES, LinkLimits, parse_url
from mav_tasks.links.base import Peer, PeerChange, PeerState, StreamLink
from mav_tasks.links.tcp_in import TcpInLink, TcpInUrl
from tests.kit.processes import free_tcp_ports

HOST, OTHER_HOST = "127.0.0.1", "127.0.0.2"
PACKET = b"a packet"
LIMIT = 10.0  # s
#: what a person reads, and what helps
IN_USE = (
    "Address already in use: end the program that has it (ss -lntup names it), or choose another"
)
RESETS = b"\1\0\0\0\0\0\0\0"  # of SO_LINGER: closing resets the connection


class Watched:
    """A link and all that it has given."""

    def __init__(self, link: StreamLink) -> None:
        self.link = link
        self.pieces: list[tuple[Peer, bytes]] = []
        self.changes: list[PeerChange] = []

    def until(self, condition: Callable[[], object]) -> None:
        """Do what a runner does until the condition holds."""
        end = time.monotonic() + LIMIT
        while not condition():
            assert time.monotonic() < end, (self.pieces, self.changes)
            select.select([self.link.fileno()], [], [], 0.01)
            self.turn()
            self.link.poll()

    def turn(self) -> None:
        self.pieces += self.link.receive(64)
        self.changes += self.link.take_changes()

    @property
    def states(self) -> list[PeerState]:
        """What the engine is told."""
        for_the_log = PeerState.HEARD, PeerState.REFUSED
        return [each.state for each in self.changes if each.state not in for_the_log]

    def heard(self, peer: Peer) -> bytes:
        return b"".join(data for who, data in self.pieces if who == peer)

    def is_up(self, sock: socket.socket) -> bool:
        return PeerChange(sock.getsockname(), PeerState.UP) in self.changes


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    """What closes links and sockets."""
    with ExitStack() as it:
        yield it


def listening(stack: ExitStack, **limits: Any) -> TcpInLink:
    link = TcpInLink(TcpInUrl("tcpin", HOST, 0), limits=replace(TO_CLIENTS, **limits))
    return stack.enter_context(closing(link))


def small(stack: ExitStack, *heard: Peer, everybody: bool = False, signed: bool = False) -> Watched:
    """Return a link for three connections, and guests for 0.2 s."""
    link = listening(stack, connections=3, unheard=0.2)
    link.watch(
        lambda peer: everybody or peer in heard,
        has_packet=lambda data: PACKET in data,
        is_signed=signed,
    )
    return Watched(link)


def dial(stack: ExitStack, link: TcpInLink, *, source: str = HOST) -> socket.socket:
    sock = socket.create_connection((HOST, link.port), LIMIT, (source, 0))
    return stack.enter_context(sock)


def up(stack: ExitStack, watched: Watched, count: int) -> list[socket.socket]:
    """Connect so many clients; give them when the link knows of all."""
    assert isinstance(watched.link, TcpInLink)
    clients = [dial(stack, watched.link) for _ in range(count)]
    watched.until(lambda: all(map(watched.is_up, clients)))
    return clients


def reset(sock: socket.socket) -> None:
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESETS)
    sock.close()


def read(sock: socket.socket, count: int) -> bytes:
    sock.settimeout(LIMIT)
    data = b""
    while len(data) < count:
        more = sock.recv(count - len(data))
        assert more, f"ended after {data!r}"
        data += more
    return data


def is_open(sock: socket.socket) -> bool:
    sock.settimeout(0.0)
    try:
        return sock.recv(1) != b""
    except BlockingIOError:
        return True
    except ConnectionError:
        return False


# listening


def test_each_connection_is_a_peer_that_comes_is_answered_and_goes(stack: ExitStack) -> None:
    link = listening(stack)
    watched = Watched(link)
    assert (link.name, link.peers, link.is_local) == (f"tcpin:{HOST}:0", (), True)
    one, two = up(stack, watched, 2)
    for each in (one, two):
        peer = each.getsockname()
        each.sendall(b"from %d" % peer[1])
        watched.until(lambda peer=peer: watched.heard(peer) == b"from %d" % peer[1])  # type: ignore[misc]
        link.send(peer, b"to %d" % peer[1])
        assert read(each, 8) == b"to %d" % peer[1]
    peer = one.getsockname()
    one.sendall(b", and last words")
    one.close()
    watched.until(lambda: PeerState.DOWN in watched.states)
    assert watched.heard(peer).endswith(b"last words")
    name = f"{HOST}:{peer[1]}"
    assert [each for each in watched.changes if each.peer == peer] == [
        PeerChange(peer, PeerState.UP),
        PeerChange(peer, PeerState.HEARD, f"{name} connected"),
        PeerChange(peer, PeerState.DOWN, f"{name} disconnected: closed by the other end"),
    ]
    with closing(TcpInLink(TcpInUrl("tcpin", "0.0.0.0", 0), limits=TO_CLIENTS)) as wide:
        assert not wide.is_local


def test_what_is_sent_to_who_is_gone_is_lost_and_said_by_nobody(stack: ExitStack) -> None:
    link = listening(stack)
    watched = Watched(link)
    (client,) = up(stack, watched, 1)
    peer = client.getsockname()
    reset(client)
    for _ in range(3):  # before the link was read, as in the middle of a turn
        link.send(peer, b"still there?")
    watched.until(lambda: PeerState.DOWN in watched.states)
    link.send(peer, b"still there?")
    assert link.lost >= 2
    assert watched.states == [PeerState.UP, PeerState.DOWN]


def test_a_piece_is_no_longer_than_a_packet_and_all_are_served_in_turn(stack: ExitStack) -> None:
    watched = Watched(listening(stack))
    one, two = up(stack, watched, 2)
    one.sendall(bytes(20_000))
    two.sendall(b"hello")
    watched.until(lambda: len(watched.heard(one.getsockname())) == 20_000)
    assert max(len(data) for _, data in watched.pieces) <= 280
    assert two.getsockname() in [peer for peer, _ in watched.pieces[:64]]


def test_one_that_comes_again_from_the_same_place_does_so_after_it_has_gone(
    stack: ExitStack,
) -> None:
    """As a box with a fixed port does, all of it before the link is read again."""
    link = listening(stack)
    watched = Watched(link)
    (client,) = up(stack, watched, 1)
    peer = client.getsockname()
    reset(client)
    with socket.socket() as again:
        again.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        again.bind(peer)
        again.connect((HOST, link.port))
        again.sendall(b"again")
        end, told = time.monotonic() + LIMIT, list[list[PeerState]]()
        while watched.heard(peer) != b"again" and time.monotonic() < end:
            select.select([link.fileno()], [], [], LIMIT)
            watched.pieces += link.receive(64)
            told.append([change.state for change in link.take_changes() if change.peer == peer])
            told[-1] = [each for each in told[-1] if each is not PeerState.HEARD]
    # the engine is told of one reading's comings before its goings
    assert told[:2] == [[PeerState.DOWN], [PeerState.UP]]


def test_who_sends_nothing_valid_gives_way_the_oldest_first(stack: ExitStack) -> None:
    watched = small(stack)
    link, silent = watched.link, up(stack, watched, 3)
    assert isinstance(link, TcpInLink)
    for _ in range(50):  # far more than there is room for, and nobody is refused
        late = dial(stack, link)
        late.sendall(PACKET)
        watched.until(lambda late=late: watched.is_up(late))  # type: ignore[misc]
        silent.append(late)
    watched.until(lambda: link.refused == 50)
    assert [is_open(each) for each in silent] == [False] * 50 + [True] * 3
    words = {change.words for change in watched.changes if change.state is PeerState.DOWN}
    assert f"{HOST}: a connection ended without a valid packet: the link is full" in words
    assert len({change.words for change in watched.changes}) < 50  # the log counts the same ones


def test_who_speaks_is_heard_at_once_among_strangers_who_do_not(stack: ExitStack) -> None:
    """In a few turns: so is one who listens, of another address, which keeps its place."""
    watched = small(stack)
    link, strangers = watched.link, list[socket.socket]()
    assert isinstance(link, TcpInLink)
    for number in range(300):
        strangers.append(dial(stack, link))
        if number % 2:
            strangers[-1].sendall(PACKET[:-1])
    listener, late = dial(stack, link, source=OTHER_HOST), dial(stack, link)
    late.sendall(PACKET)
    for _ in range(10):
        watched.turn()
    assert watched.heard(late.getsockname()) == PACKET
    assert watched.is_up(listener)
    assert len(watched.states) < 20  # the engine knows nothing of the others
    for each in strangers[-19::2]:
        each.sendall(PACKET[-1:])
        watched.until(lambda each=each: watched.heard(each.getsockname()) == PACKET)  # type: ignore[misc]
    assert is_open(listener)


def test_so_many_wait_without_a_word_and_get_a_place_that_is_free(stack: ExitStack) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (256, hard))
    watched = small(stack)
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    link = watched.link
    assert isinstance(link, TcpInLink)
    first = up(stack, watched, 3)
    waiting = [dial(stack, link) for _ in range(100)]
    while link.refused < 36:
        watched.turn()
    assert [is_open(each) for each in waiting] == [False] * 36 + [True] * 64
    first[0].close()
    waiting[40].sendall(bytes(300))
    watched.until(lambda: watched.is_up(waiting[36]))
    ends = [change.words.rpartition(": ")[2] for change in watched.changes if change.words]
    assert "bytes without a packet" in ends


@pytest.mark.parametrize("signed", [True, False])
def test_who_is_silent_on_a_link_for_signed_packets_is_closed(
    stack: ExitStack, *, signed: bool
) -> None:
    """On others it may listen: anybody could send a valid packet there."""
    watched = small(stack, signed=signed)
    (silent,) = up(stack, watched, 1)
    end = time.monotonic() + 0.5
    watched.until(lambda: time.monotonic() > end)
    assert is_open(silent) is not signed


def test_beyond_the_limit_there_is_a_place_for_a_short_time_also_for_a_stop(
    stack: ExitStack,
) -> None:
    """All places are taken by clients that are heard."""
    watched = small(stack, everybody=True)
    link, clients = watched.link, up(stack, watched, 3)
    assert isinstance(link, TcpInLink)
    for _ in range(15):
        late = dial(stack, link)
        late.sendall(PACKET)
        peer = late.getsockname()
        watched.until(lambda peer=peer: watched.heard(peer) == PACKET)  # type: ignore[misc]
        clients.append(late)
    watched.until(lambda: link.refused == 15)
    assert [is_open(each) for each in clients] == [True] * 3 + [False] * 15
    dial(stack, link)  # and says nothing
    watched.until(lambda: watched.changes[-1].state is PeerState.REFUSED)
    assert watched.changes[-1].words.endswith("without a valid packet: 0.2 s are over")


def test_without_descriptors_it_waits_for_some(stack: ExitStack) -> None:
    watched = Watched(listening(stack))
    link = watched.link
    assert isinstance(link, TcpInLink)
    client = dial(stack, link)
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (client.fileno() + 1, hard))
    try:
        assert select.select([link.fileno()], [], [], LIMIT)[0]
        link.receive(64)
        assert not select.select([link.fileno()], [], [], 0.0)[0]  # is not called for nothing
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    watched.until(lambda: watched.is_up(client))


def test_what_cannot_be_opened_is_one_clear_error(stack: ExitStack) -> None:
    port = listening(stack).port
    for url, words in (
        (f"tcpin:{HOST}:{port}", IN_USE),
        ("tcpin:no host:1", ""),
        ("tcp:no host:1", ""),
    ):
        with pytest.raises(LinkOpenError) as error:
            parse_url(url).open(limits=TO_CLIENTS)
        assert str(error.value).startswith(f"link {url} cannot be opened: ")
        assert str(error.value).endswith(words)


def test_a_slow_reader_delays_nobody_and_gets_whole_packets_the_newest_last(
    stack: ExitStack,
) -> None:
    link = listening(stack)
    watched = Watched(link)
    slow, quick = up(stack, watched, 2)
    sent = 0
    while link.lost <= 2_000:
        link.send(slow.getsockname(), sent.to_bytes(4, "big") + bytes(196))
        sent += 1
        if sent % 500 == 1:
            link.send(quick.getsockname(), b"hello")
            assert read(quick, 5) == b"hello"
        assert sent < 300_000
    time.sleep(0.15)
    link.poll()
    assert PeerChange(slow.getsockname(), PeerState.CONGESTED) in link.take_changes()
    numbers: list[int] = []
    while not numbers or numbers[-1] != sent - 1:
        link.receive(64)
        packet = read(slow, 200)
        assert packet[4:] == bytes(196)
        numbers.append(int.from_bytes(packet[:4], "big"))
    assert numbers == sorted(set(numbers))
    assert len(numbers) + link.lost == sent
    watched.until(lambda: PeerState.CLEAR in watched.states)


# dialling


def dialled(stack: ExitStack, port: int, limits: LinkLimits = TO_VEHICLES) -> Watched:
    link = parse_url(f"tcp:{HOST}:{port}").open(limits=limits)
    assert isinstance(link, StreamLink)
    return Watched(stack.enter_context(closing(link)))


def accepted(stack: ExitStack, server: socket.socket) -> socket.socket:
    server.settimeout(LIMIT)
    return stack.enter_context(server.accept()[0])


def server_at(stack: ExitStack, port: int = 0) -> socket.socket:
    return stack.enter_context(socket.create_server((HOST, port)))


def test_towards_a_vehicle_nothing_old_is_delivered_later(stack: ExitStack) -> None:
    """Its connection stalls; the newest setpoint comes next after what the system had taken."""
    server = server_at(stack)
    server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2_048)
    watched = dialled(stack, server.getsockname()[1])
    watched.until(lambda: watched.states == [PeerState.UP])
    rover = accepted(stack, server)
    peer, link = watched.changes[0].peer, watched.link
    for number in range(2_000):  # more than the system takes
        link.send(peer, number.to_bytes(4, "big") + bytes(61))
    time.sleep(0.3)
    for number in range(2_000, 2_004):
        link.send(peer, number.to_bytes(4, "big") + bytes(61))
    numbers: list[int] = []
    while not numbers or numbers[-1] != 2_003:
        link.receive(64)
        numbers.append(int.from_bytes(read(rover, 65)[:4], "big"))
    gap = next(place for place, number in enumerate(numbers) if number != place)
    assert 2_000 in numbers[gap : gap + 2], "at most one that had begun to leave is older"


def test_a_dialling_link_has_one_peer_which_comes_and_comes_back(stack: ExitStack) -> None:
    (port,) = free_tcp_ports(1)
    watched = dialled(stack, port)
    link, peer = watched.link, (HOST, port)
    watched.until(lambda: watched.changes)
    link.send(peer, b"lost")
    words = "is not available yet: Connection refused; trying again every second"
    for expected in ("is up", "is back"):
        with closing(server_at(stack, port)) as server:
            began = time.monotonic()
            watched.until(lambda expected=expected: watched.changes[-1].words == expected)  # type: ignore[misc]
            other = accepted(stack, server)
            link.send(peer, b"hello")
            assert read(other, 5) == b"hello"
            other.sendall(b"answer")
            watched.until(lambda: watched.heard(peer).endswith(b"answer"))
            other.close()
            watched.until(lambda: watched.states[-1] is PeerState.DOWN)
    assert time.monotonic() - began > 0.5, "it dials once a second"
    lost = "lost: closed by the other end; trying again every second"
    told = [(each.peer, each.words) for each in watched.changes]
    assert told == [(peer, each) for each in (words, "is up", lost, "is back", lost)]
    assert link.peers == ()


def test_one_that_never_answers_is_given_up_and_dialled_again(stack: ExitStack) -> None:
    full = stack.enter_context(socket.socket())
    full.bind((HOST, 0))
    full.listen(0)
    for _ in range(4):  # from now on nobody is answered
        sock = stack.enter_context(socket.socket())
        sock.setblocking(False)
        sock.connect_ex(full.getsockname())
    watched = dialled(stack, full.getsockname()[1])
    watched.until(lambda: watched.changes)
    (change,) = watched.changes
    assert change.words == "is not available yet: no answer; trying again every second"


def test_what_was_sent_just_before_the_end_arrives(stack: ExitStack) -> None:
    """Even with something unread, for which the system would otherwise reset the connection."""
    server = server_at(stack)
    watched = dialled(stack, server.getsockname()[1])
    watched.until(lambda: watched.changes)
    other = accepted(stack, server)
    other.sendall(b"unread" * 100)
    assert select.select([watched.link.fileno()], [], [], LIMIT)[0]
    watched.link.send(watched.changes[0].peer, b"stop")
    watched.link.close()
    assert read(other, 4) == b"stop"
    watched.link = dialled(stack, server.getsockname()[1]).link  # closed once more at the end
