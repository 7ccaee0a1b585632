"""What comes from the wire names no file: every text field of every message is a path elsewhere."""

import json
import os
import re
import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import Any

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from tests.kit import audited
from tests.kit.processes import Process, free_udp_ports, process, wait_until

CANARY = "qzx7"  # short: it fits into most fields as a whole
PATHS = (
    f"../../{CANARY}",
    f"/etc/{CANARY}",
    f"file:///{CANARY}",
    f"{CANARY}\0.tlog",
    f"~/{CANARY}",
)
FTP_PAYLOAD = 251
FTP_OPCODES = range(1, 17)  # all there are: open, create, remove, rename, list, truncate, ...
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT
TARGETS = ((7, 191), (7, 1), (0, 0))
AT_ONCE = 20  # datagrams, before the server has its turn

Event = tuple[str, list[Any]]


def with_texts(kind: Any, text: str, target: tuple[int, int]) -> Any | None:
    """Return a message whose texts are all this one; None: it has none."""
    values: dict[str, Any] = {}
    has_text = False
    lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    for name, of in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        length = lengths[name]
        if of == "char" and length > 1:
            values[name] = text.encode()[:length]
            has_text = True
        elif length:
            values[name] = [0] * length
        else:
            values[name] = {"target_system": target[0], "target_component": target[1]}.get(name, 0)
    return kind(**values) if has_text else None


def ftp(opcode: int, path: str, target: tuple[int, int]) -> Any:
    name = path.encode()
    payload = [1, 0, 0, opcode, len(name), 0, 0, 0, 0, 0, 0, 0, *name]
    padded = payload + [0] * (FTP_PAYLOAD - len(payload))
    return m.FileTransferProtocol(0, *target, padded)


def hostile() -> Iterator[Any]:
    for path in PATHS:
        for target in TARGETS:
            for kind in m.ALL.values():
                message = with_texts(kind, path, target)
                if message is not None:
                    yield message
            for opcode in FTP_OPCODES:
                yield ftp(opcode, path, target)


def heartbeat(autopilot: int = 3, kind: int = 10) -> Any:
    return m.Heartbeat(kind, autopilot, 0, 4, 3, 3)


def hears(client: socket.socket, ours: Encoder, server: tuple[str, int]) -> bool:
    """Ask something, and see that it is answered: all that was sent before has been taken in."""
    client.sendto(ours.encode(m.CommandLong(7, 191, 512, 0, 54001, 0, 0, 0, 0, 0, 0)), server)
    end = monotonic() + 0.5
    client.settimeout(0.5)
    with suppress(TimeoutError):
        while monotonic() < end:
            if client.recv(4096)[7:10] == m.CommandAck.id.to_bytes(3, "little"):
                return True
    return False


def opened_by(folder: Path, running: Process, out: Path) -> list[Event]:
    running.end()
    assert running.popen.returncode == 0, running.text
    assert "Traceback" not in running.text
    events: list[Event] = [(name, arguments) for name, arguments in json.loads(out.read_text())]
    return events


def of_canary(events: list[Event]) -> list[Event]:
    return [event for event in events if CANARY in json.dumps(event)]


def test_no_text_from_the_wire_is_a_path(tmp_path: Path) -> None:
    client_port, out = free_udp_ports(1)[0], tmp_path / "opened.json"
    with (
        socket.socket(type=socket.SOCK_DGRAM) as rover,
        socket.socket(type=socket.SOCK_DGRAM) as client,
    ):
        rover.bind(("127.0.0.1", 0))
        rover.settimeout(20)
        serve = [str(Path(audited.__file__)), str(out), "serve", "--no-push", "-v"]
        serve += ["--client", f"udpin:127.0.0.1:{client_port}"]
        serve += ["--vehicle", f"udpout:127.0.0.1:{rover.getsockname()[1]}"]
        serve += ["--store", str(tmp_path / "data" / "tasks.sqlite3")]
        serve += ["--tlog", str(tmp_path / "logs"), "--record", str(tmp_path / "records")]
        with process(*serve, folder=tmp_path, name="server") as running:
            server = rover.recvfrom(300)[1]  # its heartbeat
            to_clients = ("127.0.0.1", client_port)
            for number in (0, 7, 47, 92, 255):  # / is 47 and \ is 92, should anybody write them so
                rover.sendto(Encoder(Address(number, 1)).encode(heartbeat()), server)
            running.wait_for("rover 7: found")
            ours, theirs = Encoder(Address(255, 190)), Encoder(Address(7, 1))
            client.sendto(ours.encode(heartbeat(8, 6)), to_clients)
            sent = 0
            for message in hostile():
                client.sendto(ours.encode(message), to_clients)
                rover.sendto(theirs.encode(message), server)
                sent += 1
                if sent % AT_ONCE == 0:
                    rover.sendto(theirs.encode(heartbeat()), server)
                    wait_until(lambda: hears(client, ours, to_clients), within=10, what="an answer")
            move = m.CommandLong(7, 191, 54000, 0, 1.0, 0, 0, 5, 0, 0, 5)
            client.sendto(ours.encode(move), to_clients)
            running.wait_for("rover 7: task 1")
            events = opened_by(tmp_path, running, out)
    assert sent > 500
    assert of_canary(events) == []
    opened = [arguments for name, arguments in events if name == "open"]
    named = [arguments for arguments in opened if not isinstance(arguments[0], int)]  # else a file
    written = [Path(arguments[0]) for arguments in named if arguments[2] & WRITES]  # that is open
    elsewhere = [path for path in written if tmp_path not in path.parents]
    assert [path for path in elsewhere if path != Path(os.devnull)] == []
    # it does see what is opened
    assert {path.parent.name for path in written} >= {"data", "logs", "records"}
    assert "sqlite3.connect" in {name for name, _ in events}
    stamp = r"\d{4}-\d\d-\d\dT\d\d-\d\d-\d\dZ(\.\d+)?\.(tlog|decisions\.gz)"
    for folder in ("logs", "records"):
        assert all(re.fullmatch(stamp, path.name) for path in (tmp_path / folder).iterdir())
