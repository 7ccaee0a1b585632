"""A net in memory: as bad as asked for, and the same each time."""

from mav_tasks.links.memory import Conditions, MemoryLink, MemoryNet, Queue, Radio

BAD = Conditions(delay=0.01, jitter=0.05, loss=0.2, duplication=0.2)


def pair(net: MemoryNet) -> tuple[MemoryLink, MemoryLink]:
    return net.link("a", peers=("b",)), net.link("b")


def arrivals(net: MemoryNet, at: MemoryLink) -> list[tuple[float, bytes]]:
    """Let everything arrive; gives when, and what."""
    came: list[tuple[float, bytes]] = []
    while (when := net.next_arrival()) is not None:
        net.now = when
        net.deliver()
        came += [(when, data) for _, data in at.receive(1000)]
    return came


def traffic(seed: int, conditions: Conditions) -> list[tuple[float, bytes]]:
    net = MemoryNet(seed=seed, conditions=conditions)
    a, b = pair(net)
    for number in range(200):
        net.now = number * 0.001
        a.send("b", bytes([number]))
    return arrivals(net, b)


def test_a_datagram_arrives_after_its_delay_and_names_its_sender() -> None:
    net = MemoryNet(conditions=Conditions(delay=0.25))
    a, b = pair(net)
    a.send("b", b"hello")
    net.now = 0.2
    net.deliver()
    assert b.receive(10) == []
    assert net.next_arrival() == 0.25
    net.now = 0.25
    net.deliver()
    assert b.receive(10) == [("a", b"hello")]
    assert net.next_arrival() is None


def test_a_good_net_keeps_everything_in_order() -> None:
    came = traffic(1, Conditions())
    assert [data for _, data in came] == [bytes([n]) for n in range(200)]


def test_the_same_seed_gives_the_same_losses_doubles_and_delays() -> None:
    assert traffic(7, BAD) == traffic(7, BAD)
    assert traffic(7, BAD) != traffic(8, BAD)


def test_a_bad_net_loses_doubles_and_reorders() -> None:
    came = [data for _, data in traffic(7, BAD)]
    assert len(set(came)) < 200
    assert len(came) > len(set(came))
    assert came != sorted(came)


def through(net: MemoryNet, sizes: list[int], *, every: float) -> list[tuple[float, int]]:
    """Send datagrams from a to b; gives when each arrived, and how long it was."""
    a, b = pair(net)
    for number, size in enumerate(sizes):
        net.now = number * every
        a.send("b", bytes(size))
    return [(round(at, 6), len(data)) for at, data in arrivals(net, b)]


def test_a_radio_lets_through_what_its_rate_allows_and_keeps_the_rest_in_order() -> None:
    net = MemoryNet(conditions=Conditions(delay=0.1))
    net.buffers["a", "b"] = Radio(bytes_per_second=1000, buffer=16_000)
    assert through(net, [100, 50, 200], every=0.01) == [(0.2, 100), (0.25, 50), (0.45, 200)]


def test_a_delay_that_shrinks_lets_nothing_overtake() -> None:
    net = MemoryNet(conditions=Conditions(delay=0.0))
    net.buffers["a", "b"] = Queue(lambda now: max(0.0, 1.0 - 2 * now))
    came = through(net, [1, 2, 3, 4], every=0.4)
    assert came == [(1.0, 1), (1.0, 2), (1.0, 3), (1.2, 4)]
