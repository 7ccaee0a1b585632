"""MAVLink FTP, refusals only: without an answer a client would wait for seconds.

MAVLink guide, "File Transfer Protocol".
"""

from collections.abc import Sequence

PAYLOAD_LENGTH = 251
NAK = 129
FILE_NOT_FOUND = 10


def refusal_of(payload: Sequence[int]) -> list[int]:
    """Return the NAK to a request: same session, next sequence number, the request's opcode."""
    seq = (payload[0] | payload[1] << 8) + 1 & 0xFFFF
    session, opcode = payload[2], payload[3]
    header = [seq & 0xFF, seq >> 8, session, NAK, 1, opcode, 0, 0, 0, 0, 0, 0, FILE_NOT_FOUND]
    return header + [0] * (PAYLOAD_LENGTH - len(header))
