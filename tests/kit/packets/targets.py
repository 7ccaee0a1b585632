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
from mav_tasks.mavlink.enums import MavMissionResult
from mav_tasks.mavlink.packet import MAX_PACKET, Packet, split_datagram, with_seq
from mav_tasks.mavlink.stream import StreamSplitter
from mav_tasks.plan_files.reader import parse_plan_bytes
from mav_tasks.plan_files.writer import format_plan
from mav_tasks.services.mission_item import Item
from mav_tasks.services.mission_receiver import CAPACITY, MissionReceiver, Sender

Target = Callable[[bytes], None]

KINDS = sorted(m.ALL)
SENDERS = [Sender(name, Address(255, 190), Address(1, 1)) for name in ("alice", "bob")]


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
    assert (whole.noise, whole._rest) == (pieces.noise, pieces._rest)
    assert sum(map(len, found)) + pieces.noise + len(pieces._rest) == len(rest)
    assert len(pieces._rest) < MAX_PACKET
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


def mission_receiver(data: bytes) -> None:
    """Feed a receiver any sequence of messages: uploads are complete, and of one sender each."""
    receiver = MissionReceiver(check=_check, form=m.MissionRequest)
    now = 0.0
    for step, what in zip(data[::2], data[1::2], strict=False):
        now += step / 100
        due = receiver.next_deadline()
        if due is not None and due <= now:
            receiver.handle_deadline(now=now)
            after = receiver.next_deadline()
            assert after is None or after > now, "due again at once"
        sender, kind, seq = SENDERS[what & 1], what >> 1 & 1, what >> 5
        match what >> 2 & 7:
            case 0 | 1:
                count = seq if what != 0xFF else 65535
                receiver.count(m.MissionCount(1, 1, count, kind), sender, now=now)
            case 2 | 3 | 4 | 5:
                item = m.MissionItemInt(1, 1, seq, 3, 16, 0, 1, 0, 0, 0, 0, step, 8, 0, kind)
                receiver.item(item, sender, now=now)
            case 6:
                ack = m.MissionAck(1, 1, what >> 5, kind)
                receiver.cancelled(ack, sender, now=now)
            case _:
                receiver.finish(MavMissionResult.ACCEPTED, opaque_id=1, now=now)
        outgoing, uploads = receiver.take()
        assert len(outgoing) <= 3
        assert len(receiver.items) <= CAPACITY
        for upload in uploads:
            assert len(upload.items) <= 7, "more items than any count has named"
            assert upload.begun_at <= now


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
    target.__name__: target
    for target in (datagram, stream, decoder, mission_receiver, config, plan, link_url)
}


def _check(kind: int, seq: int, item: Item, count: int) -> MavMissionResult | None:
    assert seq < count
    return MavMissionResult.UNSUPPORTED if item.x == 13 else None


def _fields(message: m.Message) -> tuple[str, str]:
    """Return type and fields as text, in which NaN equals NaN and 0 differs from -0."""
    return message.get_type(), repr([getattr(message, name) for name in message.fieldnames])
