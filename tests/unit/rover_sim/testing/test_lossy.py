"""Each way of the net can be bad by itself, from now on or for a while."""

from typing import Any

import pytest

from mav_tasks.in_memory import CLIENT_LINK, VEHICLE_LINK
from rover_sim.testing.lossy import LossyLink, LossyNet


def through(net: LossyNet, source: str, target: str) -> int:
    """Send a thousand datagrams; gives how many arrive within a second."""
    link = net.link(target)
    for _ in range(1000):
        net.send(source, target, b"x")
    net.now += 1.0
    net.deliver()
    return len(link.receive(10_000))


def of_each_way(net: LossyNet) -> list[int]:
    ways = (("client1", CLIENT_LINK), (VEHICLE_LINK, "rover1"))
    return [n for a, b in ways for n in (through(net, a, b), through(net, b, a))]


def test_the_ways_of_the_leg_are_bad_both_ways_and_no_other() -> None:
    net = LossyNet(seed=1)
    link = LossyLink(net)
    assert of_each_way(net) == [1000] * 4
    link(loss=0.3)
    assert of_each_way(net) == [pytest.approx(700, abs=60)] * 2 + [1000] * 2
    link(duplication=0.5, leg="rover")
    assert of_each_way(net) == [pytest.approx(n, abs=60) for n in (700, 700, 1500, 1500)]
    link(delay=2.0, leg="both")
    assert of_each_way(net) == [0] * 4
    link.mend()
    net.now += 10.0
    net.deliver()
    assert of_each_way(net) == [1000] * 4


def test_with_a_block_it_is_bad_while_the_block_runs() -> None:
    net = LossyNet(seed=1)
    link = LossyLink(net)
    link(loss=1.0, leg="rover")
    with link(loss=1.0, leg="client"):
        assert of_each_way(net) == [0] * 4
    assert of_each_way(net) == [1000, 1000, 0, 0]


def test_jitter_lets_datagrams_overtake_each_other() -> None:
    net = LossyNet(seed=1)
    LossyLink(net)(jitter=0.5)
    link = net.link(CLIENT_LINK)
    for number in range(20):
        net.send("client1", CLIENT_LINK, bytes([number]))
    net.now = 0.4
    net.deliver()
    came = [data[0] for _, data in link.receive(100)]
    assert 0 < len(came) < 20
    assert came != sorted(came)


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"loss": 1.1}, "loss must be 0 to 1, not 1.1"),
        ({"duplication": -0.1}, "duplication must be 0 to 1, not -0.1"),
        ({"delay": -1.0}, "delay must be 0 s or more, not -1.0"),
        ({"jitter": float("nan")}, "jitter must be 0 s or more, not nan"),
        ({"leg": "wifi"}, "leg must be one of client, rover, both, not 'wifi'"),
    ],
)
def test_what_makes_no_sense_is_refused(how: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        LossyLink(LossyNet(seed=1))(**how)
