"""What gateways say to each other: authenticated, in order, with ages; no STOP is lost."""

from math import inf

import pytest

from mav_tasks.fleet.exchange import BEAT, SILENCE, Arrived, Exchange
from mav_tasks.fleet.lease import Lease, Terms
from mav_tasks.fleet.notification import SESSION, Datagram, Kind, Packet, Seal
from mav_tasks.fleet.outbox import ALL, LIMIT, Outbox, Waiting

SEAL = Seal(b"secret of the fleet", "fleet 1")
AHEAD = {"a": 0.0, "b": 5_000.0}  # s, of their monotonic clocks


def session(number: int) -> bytes:
    return bytes([number]) * SESSION


class Net:
    """Two gateways, and what is under way between them; true time in seconds."""

    def __init__(self) -> None:
        self.now = 100.0
        self.outboxes = {name: Outbox() for name in AHEAD}
        self.gateways = {name: Exchange(name, self.outboxes[name]) for name in AHEAD}
        self.lost = 0
        self.is_cut = False
        self.recorded: list[tuple[str, str]] = []  # receiver, text
        for number, name in enumerate(AHEAD, 1):
            self.begin(name, number)
        for _ in range(3):
            self.exchange()

    def local(self, name: str) -> float:
        return self.now + AHEAD[name]

    def begin(self, name: str, number: int) -> None:
        self.gateways[name].begin(SEAL, session(number), now=self.local(name))

    def put(self, name: str, payload: bytes, *, first: bool = False, until: float = 1.0) -> None:
        now = self.local(name)
        self.outboxes[name].put(
            "b" if name == "a" else "a", Waiting(payload, now, now + until, first)
        )

    def exchange(self, delay: float = 0.01) -> list[Arrived]:
        """Let each say what it has to, and the other one hear it."""
        texts = [
            (other, text)
            for name, other in (("a", "b"), ("b", "a"))
            for _, text in self.gateways[name].notifications(self.local(name))
        ]
        self.now += delay
        self.recorded += texts
        if self.is_cut:
            return []
        return [
            each
            for name, text in texts
            for each in self.gateways[name].receive(text, now=self.local(name))
        ]


def test_both_meet_and_datagrams_come_in_order_those_that_are_first_before() -> None:
    net = Net()
    assert [net.gateways[name].peers for name in "ab"] == [{"b"}, {"a"}]
    net.put("a", b"1")
    net.put("a", b"2")
    net.put("a", b"stop", first=True)
    found = net.exchange()
    assert [(each.sender, each.payload, each.first) for each in found] == [
        ("a", b"stop", True),
        ("a", b"1", False),
        ("a", b"2", False),
    ]


def test_how_long_one_waited_is_never_underestimated() -> None:
    net = Net()
    net.put("a", b"x")
    net.now += 0.2  # in the outbox
    (found,) = net.exchange(delay=0.3)
    assert 0.5 <= found.waited < 0.53  # the fastest trip in the other direction is 10 ms
    net.put("a", b"y", until=0.4)
    net.put("a", b"stop", first=True, until=0.4)
    (found,) = net.exchange(delay=0.6)  # the other one is of no use any more
    assert (found.payload, net.gateways["b"].late) == (b"stop", 1)
    assert found.waited >= 0.6


def test_a_stranger_a_recording_and_another_fleet_are_refused() -> None:
    net = Net()
    net.put("a", b"x")
    assert len(net.exchange()) == 1
    b, now = net.gateways["b"], net.local("b")
    forged = Packet(Kind.MAIL, "a", session(1), 999, datagrams=[Datagram(b"drive")])
    for seal in (Seal(b"another secret", "fleet 1"), Seal(b"secret of the fleet", "fleet 2")):
        assert b.receive(seal.text(forged, session(2)), now=now) == []
    for text in ("", "no base64", "AAAA", "ä"):
        assert b.receive(text, now=now) == []
    refused = b.refused
    for name, text in net.recorded:
        if name == "b":
            assert b.receive(text, now=now) == []
    assert b.refused > refused
    net.begin("b", 3)  # it listens again: what was recorded before is not valid either
    for name, text in net.recorded:
        if name == "b":
            assert b.receive(text, now=now) == []


def test_what_is_first_outlasts_a_time_without_a_connection_and_the_rest_does_not() -> None:
    net = Net()
    net.put("a", b"stop", first=True, until=1.0)
    net.put("a", b"telemetry", until=1.0)
    net.now += 60.0  # nothing is sent or received: the database hangs
    net.begin("a", 4)
    net.begin("b", 5)
    found = [each for _ in range(4) for each in net.exchange()]
    assert [each.payload for each in found] == [b"stop"]
    assert found[0].waited >= 60.0
    net.put("a", b"stop", first=True, until=1.0)
    net.gateways["a"].notifications(net.local("a") + SILENCE)  # only the other one is away
    net.now += SILENCE + 1.0
    assert [each for _ in range(4) for each in net.exchange()] == []


def test_what_is_first_is_sent_again_after_a_lost_connection_and_the_rest_is_not() -> None:
    net = Net()
    net.put("a", b"stop", first=True, until=5.0)
    net.put("a", b"telemetry", until=5.0)
    net.is_cut = True
    assert net.exchange() == []
    net.is_cut = False
    net.begin("a", 4)
    found = [each for _ in range(4) for each in net.exchange()]
    assert [each.payload for each in found] == [b"stop"]
    assert net.gateways["b"].lost >= 1
    net.now += BEAT
    net.exchange()
    net.begin("a", 5)  # b has told that it has it
    assert [each for _ in range(4) for each in net.exchange()] == []


def test_too_many_that_wait_are_dropped_the_oldest_first_but_no_stop() -> None:
    box = Outbox()
    for number in range(LIMIT + 10):
        box.put("b", Waiting(str(number).encode(), 0.0, inf))
    box.put("b", Waiting(b"stop", 0.0, inf, first=True))
    taken = box.take("b", 10**6, each=6, now=0.0)
    assert [each.payload for each in taken[:2]] == [b"stop", b"10"]
    assert (len(taken), box.dropped) == (LIMIT + 1, 10)


def test_what_is_first_for_all_reaches_each_that_is_met_once_and_what_is_late_nobody() -> None:
    box, b = Outbox(), frozenset("b")
    for number in range(LIMIT + 3):  # of one long ago too many wait, of those just now none
        box.put(ALL, Waiting(b"%d" % number, 2.0 * (number > 2), 9.0, first=True))
    box.put(ALL, Waiting(b"to nobody", 2.0, 9.0))
    box.put("b", Waiting(b"late", 2.0, 2.5))
    box.meet(b, now=2.0)
    box.put(ALL, Waiting(b"last", 2.0, 9.0))
    box.meet(frozenset(), now=2.0)
    box.meet(b, now=3.0)
    assert [each.payload for each in box.take("b", 17, each=7, now=3.0)] == [b"3", b"4"]
    found = [each.payload for each in box.take("b", 99_999, each=6, now=3.0)]
    assert (len(found), found[-1], box.expired) == (LIMIT - 1, b"last", 1)
    box.put("b", Waiting(b"late", 3.0, 3.5))
    assert box.take("b", 99, each=6, now=4.0) == []
    box.meet(frozenset("bc"), now=99.0)
    assert box.take("c", 99, each=6, now=99.0) == []


def test_a_lease_takes_no_answer_of_another_time_and_no_terms_without_a_margin() -> None:
    with pytest.raises(ValueError, match="renewal < term - margin < term"):
        Terms(margin=0.9)
    lease = Lease(Terms())
    lease.joined(2, sent=0.0, now=0.0)
    assert lease.refused(1, now=0.1) == lease.renewed(1, sent=0.1, now=0.1) == []
    lease.renewed(2, sent=0.1, now=0.95)
    assert lease.next_deadline() == 1.1, "it came too late"
