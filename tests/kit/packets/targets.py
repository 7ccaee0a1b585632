"""Functions that read bytes or text from outside, as fuzz targets that must never raise.

Their results must satisfy invariants.
"""

from collections.abc import Callable, Mapping
from itertools import pairwise
from struct import pack

from mav_tasks.basics.errors import ConfigError, LinkUrlError, PlanFileError
from mav_tasks.config.configuration import merged
from mav_tasks.config.toml_file import decoded, layer_of
from mav_tasks.links.endpoint import HostUrl
from mav_tasks.links.serial import SerialUrl
from mav_tasks.links.url import parse_url
from mav_tasks.mavlink.codec import Decoder
from mav_tasks.mavlink.packet import MAX_PACKET, split_datagram, with_seq
from mav_tasks.mavlink.stream import StreamSplitter
from mav_tasks.plans import fence_items, rally_items
from mav_tasks.plans.reader import parse_plan_bytes
from mav_tasks.plans.writer import format_plan

Target = Callable[[bytes], None]
JUMP = 177  # MAV_CMD_DO_JUMP


def datagram(data: bytes) -> None:
    """Split a datagram: its packets are pieces of it, in order."""
    packets = split_datagram(data)
    at = 0
    for packet in packets:
        at = data.index(packet.raw, at) + len(packet.raw)
        assert packet.raw[0] in (0xFD, 0xFE)
        assert len(packet.raw) <= MAX_PACKET
        assert split_datagram(packet.raw) == [packet]
        assert split_datagram(with_seq(packet, 7))[0].seq == 7
        Decoder().decode(packet)


def stream(data: bytes) -> None:
    """Split a stream: any fragmentation gives the same packets, and every byte is accounted for."""
    cuts, rest = data[:4], data[4:]
    edges = [0, *sorted(cut * len(rest) // 255 for cut in cuts), len(rest)]
    whole, pieces = StreamSplitter(), StreamSplitter()
    expected = [packet.raw for packet in whole.feed(rest, now=0.0)]
    found: list[bytes] = []
    for start, stop in pairwise(edges):
        found += [packet.raw for packet in pieces.feed(rest[start:stop], now=0.0)]
    assert found == expected
    assert repr(whole) == repr(pieces)  # noise, and bytes kept
    kept = len(rest) - sum(map(len, found)) - pieces.noise
    assert f"({kept} bytes kept" in repr(pieces)
    assert 0 <= kept < MAX_PACKET
    for packet in pieces.feed(bytes(MAX_PACKET), now=60.0):
        assert packet.raw[0] in (0xFD, 0xFE)


def config(data: bytes) -> None:
    """Parse any file into settings, or into one-line faults that start with the file's name."""
    try:
        layer = layer_of(decoded(data, name="mine.toml"), name="mine.toml")
        merged([layer])
    except ConfigError as error:
        assert error.faults
        for fault in error.faults:
            assert fault.startswith("mine.toml"), fault
            assert fault.isprintable(), fault


def plan(data: bytes) -> None:
    """Parse any file into a plan that can be formatted and sent, or refuse it in one line."""
    try:
        found = parse_plan_bytes(data)
    except PlanFileError as error:
        assert len(str(error).splitlines()) == 1, str(error)
        assert len(str(error)) < 200
        return
    format_plan(found)
    for item in (*found.items, *fence_items(found), *rally_items(found)):
        place = item.x, item.y, item.z
        pack("<4f2ifH2B", *item.params, *place, item.command, item.frame, item.autocontinue)
    jumps = [item.params[0] for item in found.items if item.command == JUMP]
    assert set(jumps) <= set(range(len(found.items)))


def link_url(data: bytes) -> None:
    """Parse any text into a link with a host or device, or refuse it in one line."""
    text = data.decode("utf-8", "replace")
    try:
        found = parse_url(text)
    except LinkUrlError as error:
        assert str(error).isprintable() or not text.isprintable()
        return
    if isinstance(found, HostUrl):
        assert found.host
        assert 0 < found.port < 65536
    else:
        assert isinstance(found, SerialUrl)
        assert found.device
        assert parse_url(str(found)) == found


TARGETS: Mapping[str, Target] = {
    target.__name__: target for target in (datagram, stream, config, plan, link_url)
}
