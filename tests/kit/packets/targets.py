"""Functions that read bytes or text from outside, as fuzz targets that must never raise.

Their results must satisfy invariants; the decoder's must match pymavlink's.
"""

from collections.abc import Callable, Mapping
from itertools import pairwise

from fastcrc.crc16 import mcrf4xx

from mav_tasks.config.configuration import merged
from mav_tasks.config.toml_file import decoded, layer_of
from mav_tasks.errors import ConfigError, LinkUrlError, PlanFileError
from mav_tasks.links.endpoint import HostUrl
from mav_tasks.links.serial import SerialUrl
from mav_tasks.links.url import parse_url
from mav_tasks.mavlink import _dialect
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Packer
from mav_tasks.mavlink.packet import MAX_PACKET, Packet, split_datagram, with_seq
from mav_tasks.mavlink.stream import StreamSplitter
from mav_tasks.plan_files.reader import parse_plan_bytes
from mav_tasks.plan_files.writer import format_plan

Target = Callable[[bytes], None]

KINDS = sorted(m.ALL)


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


def decoder(data: bytes) -> None:
    """Decode any payload like pymavlink, and pack the message like pymavlink."""
    kind = m.ALL[KINDS[int.from_bytes(data[:2], "little") % len(KINDS)]]
    payload = data[2 : 2 + 255]
    head = bytes([len(payload), 0, 0, 9, 1, 2]) + kind.id.to_bytes(3, "little")
    crc = mcrf4xx(head + payload + bytes([kind.crc_extra]))
    raw = b"\xfd" + head + payload + crc.to_bytes(2, "little")
    packet = Packet(raw, 9, Address(1, 2), kind.id)
    ours, theirs = Decoder().decode(packet), _dialect.MAVLink(None).decode(bytearray(raw))
    assert ours is not None
    assert _fields(ours) == _fields(theirs)
    mav = _dialect.MAVLink(None, srcSystem=1, srcComponent=2)
    mav.seq = 9
    assert Packer().pack(ours, Address(1, 2), seq=9) == theirs.pack(mav)
    flipped = bytearray(raw)
    flipped[len(data) % (len(raw) - 10) + 10] ^= 1 << len(data) % 8
    assert Decoder().decode(packet._replace(raw=bytes(flipped))) is None


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
    """Parse any file into a plan that can be formatted, or refuse it in one line."""
    try:
        found = parse_plan_bytes(data)
    except PlanFileError as error:
        assert len(str(error).splitlines()) == 1, str(error)
        return
    format_plan(found)


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
    target.__name__: target for target in (datagram, stream, decoder, config, plan, link_url)
}


def _fields(message: m.Message) -> tuple[str, str]:
    """Return type and fields as text, in which NaN equals NaN and 0 differs from -0."""
    return message.get_type(), repr([getattr(message, name) for name in message.fieldnames])
