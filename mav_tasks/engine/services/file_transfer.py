"""MAVLink FTP, the server's side, as far as saying no. Pure.

MAVLink guide, "File Transfer Protocol". There are no files here. MAVProxy looks for a
component's parameters in a file first, and waits 11 s for an answer before it asks in another way.
Who reads an ArduPilot's parameters from its file asks nobody for a list.
"""

from collections.abc import Hashable

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address

NETWORK = 0
ACK, NAK = 128, 129
FILE_NOT_FOUND = 10
TERMINATE_SESSION, OPEN_TO_READ = 1, 4
GIVEN_UP = 10.0  # s without a request, after which an autopilot itself may end a session
#: opcodes that change no file, nor end all sessions, in one of which somebody may write: none,
#: TerminateSession, ListDirectory, OpenFileRO, ReadFile, CalcFileCRC32 and BurstReadFile
READING = frozenset({0, 1, 3, 4, 5, 14, 15})
#: offsets in the payload: session after a 16-bit sequence number, then the opcode
SESSION, OPCODE, DATA = 2, 3, 12
BURST_READ = 15  # a whole file: one request is answered by many packets
PARAMETERS = list(b"@PARAM/param.pck")  # ArduPilot's file of all parameters; options may follow


def reads(request: m.FileTransferProtocol) -> bool:
    """Whether a request changes no file."""
    return request.payload[OPCODE] in READING


def opens_parameters(request: m.FileTransferProtocol) -> bool:
    """Whether a request opens the file of all parameters."""
    payload = request.payload
    return payload[OPCODE] == OPEN_TO_READ and payload[DATA:][: len(PARAMETERS)] == PARAMETERS


class Writers:
    """Who writes files: a session is ended by its number, by anybody who says it.

    One that reads may be: it is read again. But half a file that was written stays.
    """

    def __init__(self) -> None:
        self._writing: dict[Hashable, float] = {}  # when each has written last

    def __repr__(self) -> str:
        return f"Writers({self._writing})"

    def ends_anothers(self, request: m.FileTransferProtocol, who: Hashable, *, now: float) -> bool:
        """Return whether a request may end what another client is writing."""
        if request.payload[OPCODE] != TERMINATE_SESSION:
            return False
        return any(each != who and now - at < GIVEN_UP for each, at in self._writing.items())

    def note(self, request: m.FileTransferProtocol, who: Hashable, *, now: float) -> None:
        if not reads(request):
            self._writing = {each: at for each, at in self._writing.items() if now - at < GIVEN_UP}
            self._writing[who] = now
        elif request.payload[OPCODE] == TERMINATE_SESSION:
            self._writing.pop(who, None)


def refusal(request: m.FileTransferProtocol, *, to: Address) -> m.FileTransferProtocol | None:
    """Return the NAK that answers a request: its session, the next number; None for an answer."""
    payload = request.payload
    opcode = payload[OPCODE]
    if opcode in (ACK, NAK):
        return None
    seq = (payload[0] | payload[1] << 8) + 1 & 0xFFFF
    header = [seq & 0xFF, seq >> 8, payload[SESSION], NAK, 1, opcode]
    answer = [*header, *(0,) * 6, FILE_NOT_FOUND]
    return m.FileTransferProtocol(NETWORK, *to, answer + [0] * (len(payload) - len(answer)))
