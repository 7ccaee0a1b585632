"""A net in memory: as bad as asked for, and the same each time."""

from mav_tasks.links.memory import Buffer, Conditions, MemoryNet, Queue, Radio

BAD = Conditions(delay=0.01, jitter=0.05, loss=0.2, duplication=0.2)
SENT = [bytes([number]) for number in range(200)]


def arrivals(
    conditions: Conditions,
    datagrams: list[bytes],
    *,
    every: float = 0.001,
    seed: int = 7,
    buffer: Buffer | None = None,
) -> list[tuple[float, bytes]]:
    """Send datagrams from a to b; return when each arrived."""
    net = MemoryNet(seed=seed, conditions=conditions)
    a, b = net.link("a", peers=("b",)), net.link("b")
    if buffer is not None:
        net.buffers["a", "b"] = buffer
    for number, data in enumerate(datagrams):
        net.now = number * every
        a.send("b", data)
    came: list[tuple[float, bytes]] = []
    while (when := net.next_arrival()) is not None:
        net.now = when
        net.deliver()
        came += [(round(when, 6), data) for sender, data in b.receive(1000) if sender == "a"]
    return came


def test_a_good_net_keeps_the_order_and_a_bad_one_loses_doubles_and_reorders() -> None:
    assert [data for _, data in arrivals(Conditions(), SENT)] == SENT
    assert arrivals(Conditions(delay=0.25), SENT[:1]) == [(0.25, SENT[0])]
    came = [data for _, data in arrivals(BAD, SENT)]
    assert len(set(came)) < min(len(SENT), len(came))
    assert came != sorted(came)
    assert arrivals(BAD, SENT) == arrivals(BAD, SENT) != arrivals(BAD, SENT, seed=8)


def test_what_queues_is_in_order_at_the_rate_of_a_radio_or_by_a_delay_that_shrinks() -> None:
    sizes = [bytes(100), bytes(50), bytes(200)]
    radio = Radio(bytes_per_second=1000, buffer=16_000)
    came = arrivals(Conditions(delay=0.1), sizes, every=0.01, buffer=radio)
    assert came == [(0.2, sizes[0]), (0.25, sizes[1]), (0.45, sizes[2])]
    queue = Queue(lambda now: max(0.0, 1.0 - 2 * now))
    came = arrivals(Conditions(delay=0.0), SENT[:4], every=0.4, buffer=queue)
    assert [at for at, _ in came] == [1.0, 1.0, 1.0, 1.2]


def test_a_radio_drops_what_its_buffer_has_no_room_for() -> None:
    came = arrivals(Conditions(), SENT[:5], buffer=Radio(bytes_per_second=10.0, buffer=2))
    assert [data for _, data in came] == SENT[:2]
