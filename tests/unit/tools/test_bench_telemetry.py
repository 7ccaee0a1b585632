"""The telemetry of the benches is what the server wants from a rover."""

from importlib import import_module

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.packet import split_datagram

forwarding = import_module("tools.bench.forwarding")  # mypy knows it by another name


def test_a_repeated_second_has_every_wanted_message_at_its_rate() -> None:
    packets = forwarding._telemetry()
    ids = [split_datagram(packet)[0].message_id for packet in packets]
    seconds = ids.count(m.Heartbeat.id)
    for wanted, interval in forwarding.WANTED.items():
        assert ids.count(wanted) == seconds * max(1, round(1 / interval))
