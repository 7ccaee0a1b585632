"""Packets as pymavlink makes them, of kinds that a server seldom sends."""

import os
from io import BytesIO

os.environ.setdefault("MAVLINK20", "1")

from pymavlink.dialects.v20 import ardupilotmega


def _packed(*, signed: bool = False, v1: bool = False) -> bytes:
    link = ardupilotmega.MAVLink(BytesIO(), srcSystem=1, srcComponent=1)
    if signed:
        link.signing.secret_key = b"0123456789abcdef" * 2
        link.signing.sign_outgoing = True
        link.signing.timestamp = 1_000
    message = ardupilotmega.MAVLink_attitude_message(7, 0.25, 0.5, 1.0, 0.0, 0.0, 0.0)
    return bytes(message.pack(link, force_mavlink1=v1))


SIGNED = _packed(signed=True)
V1 = _packed(v1=True)

#: AHRS of ArduPilot's own dialect, which ours does not have
UNKNOWN = bytes(
    ardupilotmega.MAVLink_ahrs_message(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0).pack(
        ardupilotmega.MAVLink(BytesIO(), srcSystem=1, srcComponent=1)
    )
)

_RAW = _packed()
WRONG_CRC = _RAW[:-1] + bytes([_RAW[-1] ^ 0x55])
