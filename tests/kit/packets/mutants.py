"""Packets of every kind, as any sender may send them, and damaged ones.

Built with stock pymavlink. ``broken`` packets have a wrong CRC, length or end; ``absurd`` ones are
complete, with extreme field values.
"""

import struct
from random import Random
from typing import Any, NamedTuple

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import common

from mav_tasks.mavlink import messages
from tests.kit.client import command_long, heartbeat, rc_override, set_mode, setpoint, sticks

#: of pymavlink's own dialect, and of messages that only ours has
CRC_EXTRA = {
    **{number: kind.crc_extra for number, kind in messages.ALL.items()},
    **{number: kind.crc_extra for number, kind in common.mavlink_map.items()},
}
SIGNED = 1
SIGNATURE = 13  # bytes: link id, 48 bits of time, 48 bits of hash
HEADER = 10
COMMANDS = (
    *(16, 19, 20, 22, 93, 115, 176, 178, 192, 193, 213, 224, 300, 400, 410, 510, 511, 512, 519),
    *(54000, 54001, 54002, 54003, 54010, 54011, 54012, 54013, 54014),
)
ODD_FLOATS = tuple(
    struct.pack("<f", value)
    for value in (float("nan"), float("inf"), float("-inf"), 3.4e38, -3.4e38, 1e-45, -0.0, 2.0**31)
)
ODD_BYTES = (b"\x00", b"\xff", b"\x7f", b"\x80", b"\x01")
SYSTEMS = (1, 1, 1, 2, 0, 255, 250, 9)
COMPONENTS = (1, 1, 191, 190, 0)


class Mutant(NamedTuple):
    """Bytes to send, with the name of their mutation."""

    how: str
    data: bytes


def badly_signed(packet: bytes, random: Random) -> bytes:
    """Return a MAVLink 2 packet with the signed flag, a valid CRC and a random signature."""
    flagged = bytearray(packet)
    flagged[2] |= SIGNED
    return mended(bytes(flagged)) + random.randbytes(SIGNATURE)


def mended(packet: bytes) -> bytes:
    """Return a MAVLink 2 packet with the correct CRC for its bytes."""
    end = HEADER + packet[1]
    extra = CRC_EXTRA[int.from_bytes(packet[7:10], "little")]
    crc = mcrf4xx(packet[1:end] + bytes((extra,)))
    return packet[:end] + struct.pack("<H", crc) + packet[end + 2 :]


class Mutants:
    """An endless source of mutants; only ``random`` decides."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._sent: list[bytes] = []  # recent mutants, to be replayed
        self._kinds = list(common.mavlink_map.values())
        self._mav = common.MAVLink(None, 255, 190)

    def good(self) -> bytes:
        """Return a valid packet."""
        random = self._random
        self._mav.srcSystem = random.choice(SYSTEMS)
        self._mav.srcComponent = random.choice(COMPONENTS)
        self._mav.seq = random.randrange(256)
        packet: bytes = self._message().pack(self._mav)
        return packet

    def any(self) -> Mutant:
        """Return any mutant, broken or complete."""
        random = self._random
        if random.random() < 0.8:
            return self.broken()
        if self._sent and random.random() < 0.3:
            return Mutant("replayed", random.choice(self._sent))
        if random.random() < 0.3:
            return self._keep(Mutant("badly signed", badly_signed(self.good(), random)))
        return self.absurd()

    def broken(self) -> Mutant:
        """Return one with a wrong CRC, length or end; 1 of 65,536 is valid by chance."""
        random, packet = self._random, bytearray(self.good())
        match random.randrange(7):
            case 0:
                for _ in range(random.randrange(1, 9)):
                    packet[random.randrange(len(packet))] ^= 1 << random.randrange(8)
                return Mutant("bits flipped", bytes(packet))
            case 1:
                packet[random.randrange(10, len(packet))] ^= 1 << random.randrange(8)
                return Mutant("one bit flipped", bytes(packet))
            case 2:
                return Mutant("truncated", bytes(packet[: random.randrange(1, len(packet))]))
            case 3:
                packet[1] = random.choice((0, 1, packet[1] + 1 & 0xFF, packet[1] - 1 & 0xFF, 255))
                return Mutant("length wrong", bytes(packet))
            case 4:
                other = self.good()
                halves = packet[: random.randrange(1, len(packet))] + other[1:]
                return Mutant("glued together", bytes(halves))
            case 5:
                fields = packet[HEADER:-2]
                if fields:
                    at = random.randrange(len(fields))
                    packet[HEADER + at] ^= 0xFF
                return Mutant("signed, CRC wrong", self._flagged(packet))
            case _:
                return Mutant("noise", random.randbytes(random.randrange(1, 300)))

    def absurd(self) -> Mutant:
        """Return a complete packet with absurd field values."""
        random, packet = self._random, bytearray(self.good())
        size = len(packet) - HEADER - 2
        for _ in range(random.randrange(1, 5)):
            odd = random.choice((ODD_FLOATS, ODD_BYTES))
            value = random.choice(odd)
            step = len(value)
            if size >= step:
                at = HEADER + random.randrange(size // step) * step
                packet[at : at + step] = value
        return self._keep(Mutant("fields at limits", mended(bytes(packet))))

    def _flagged(self, packet: bytearray) -> bytes:
        packet[2] |= SIGNED
        return bytes(packet) + self._random.randbytes(SIGNATURE)

    def _keep(self, mutant: Mutant) -> Mutant:
        if len(self._sent) < 200:
            self._sent.append(mutant.data)
        else:
            self._sent[self._random.randrange(200)] = mutant.data
        return mutant

    def _message(self) -> Any:
        random = self._random
        if random.random() < 0.3:
            kind = random.choice(self._kinds)
            return _Raw(kind, random.randbytes(kind.unpacker.size))
        return random.choice(
            (self._command, self._motion, self._plan, self._telemetry, heartbeat)
        )()

    def _command(self) -> Any:
        random = self._random
        target = random.choice(((1, 191), (1, 1), (2, 191), (2, 1), (0, 0)))
        command = random.choice(COMMANDS)
        params = [random.choice((0.0, 1.0, 2.0, 5.0, 15.0, 300.0, 54000.0)) for _ in range(7)]
        if random.random() < 0.7:
            return command_long(command, *params, target=target)
        return common.MAVLink_command_int_message(
            *target, random.choice((0, 1, 3, 6)), command, 0, 0, *params[:4], 470000000, 80000000, 0
        )

    def _motion(self) -> Any:
        random, system = self._random, self._random.choice((1, 2))
        return random.choice(
            (
                setpoint(0.5, system=system),
                sticks(500, system=system),
                rc_override(1500, 1500, 1900, 1500, system=system),
                set_mode(random.choice((0, 4, 10, 11, 15)), system=system),
                common.MAVLink_param_set_message(system, 191, b"TSK_SPEED", 0.5, 9),
                common.MAVLink_param_request_list_message(system, 191),
                _Raw(messages.CommandCancel, struct.pack("<HBB", 54000, system, 191)),
            )
        )

    def _plan(self) -> Any:
        random, system = self._random, self._random.choice((1, 2))
        to = (system, random.choice((1, 191)))
        kind = random.choice((0, 0, 1, 2, 255))
        seq = random.randrange(4)
        item = (seq, 3, 16, 0, 1, 0.0, 0.0, 0.0, 0.0, 470000000, 80000000, 0.0, kind)
        return random.choice(
            (
                common.MAVLink_mission_count_message(*to, random.choice((0, 1, 2, 65535)), kind),
                common.MAVLink_mission_item_int_message(*to, *item),
                common.MAVLink_mission_request_list_message(*to, kind),
                common.MAVLink_mission_request_int_message(*to, seq, kind),
                common.MAVLink_mission_clear_all_message(*to, kind),
                common.MAVLink_mission_ack_message(*to, 0, kind),
                common.MAVLink_mission_set_current_message(*to, seq),
            )
        )

    def _telemetry(self) -> Any:
        random = self._random
        return random.choice(
            (
                common.MAVLink_heartbeat_message(10, 3, random.choice((1, 129)), 15, 4, 3),
                common.MAVLink_local_position_ned_message(1000, 1, 1, 0, 0.1, 0, 0),
                common.MAVLink_attitude_message(1000, 0, 0, 1, 0, 0, 0.1),
                common.MAVLink_global_position_int_message(1000, 47, 8, 0, 0, 0, 0, 0, 0),
                common.MAVLink_command_ack_message(random.choice(COMMANDS), random.randrange(9)),
                common.MAVLink_home_position_message(47, 8, 0, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0),
                common.MAVLink_gps_global_origin_message(470000000, 80000000, 0),
                common.MAVLink_param_value_message(b"WP_SPEED", 1.0, 9, 1, 0),
                common.MAVLink_mission_current_message(0),
            )
        )


class _Raw:
    """A message with raw bytes as payload, for values that pymavlink cannot pack from numbers."""

    def __init__(self, kind: Any, payload: bytes) -> None:
        self._kind = kind
        self._payload = payload

    def pack(self, mav: Any) -> bytes:
        """Return its packet, like pymavlink's own messages."""
        payload = self._payload.rstrip(b"\0") or self._payload[:1]
        number = self._kind.id
        head = struct.pack(
            "<BBBBBBHB",
            *(len(payload), 0, 0, mav.seq, mav.srcSystem, mav.srcComponent),
            *(number & 0xFFFF, number >> 16),
        )
        crc = mcrf4xx(head + payload + bytes((self._kind.crc_extra,)))
        return b"\xfd" + head + payload + struct.pack("<H", crc)
