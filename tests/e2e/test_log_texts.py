"""What rovers say, and what cannot be read, in the log of a real server."""

import re
import socket
from pathlib import Path

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from tests.kit.processes import free_udp_ports, stand, wait_until

LEVELS = ["ERROR"] * 4 + ["WARNING", "INFO", "INFO", "DEBUG"]  # by MAV_SEVERITY
#: local time with its zone, level, words
LINE = r"(?m)^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}[+-]\d\d:\d\d (\w+ rover 42\b.*)$"


def test_texts_are_told_by_their_severity_whole_once_and_not_without_end(tmp_path: Path) -> None:
    (port,) = free_udp_ports(1)
    vehicles = ("--vehicle", f"udpin:127.0.0.1:{port}", "-v")
    rover, gimbal, other = (Encoder(Address(*who)) for who in ((42, 1), (42, 154), (43, 1)))
    with (
        stand(tmp_path, *vehicles) as running,
        socket.socket(type=socket.SOCK_DGRAM) as talker,
        socket.socket(type=socket.SOCK_DGRAM) as stranger,
    ):
        for each in (talker, stranger):
            each.connect(("127.0.0.1", port))
        said = [m.Statustext(severity, b"of %d" % severity) for severity in range(8)]
        said += [m.Statustext(3, b"a" * 50, 5, 0), m.Statustext(3, b"b" * 30, 5, 1)]
        for message in said:
            talker.send(rover.encode(message))
        talker.send(gimbal.encode(m.Statustext(4, b"\x1b[31mhot\nERROR forged")))

        def told() -> bool:
            stranger.send(b"\xfd\x80$GPGGA" * 10)
            return "one whole MAVLink packet" in running.server.text

        wait_until(told, within=20, what="the words about noise")
        for number in range(500):
            talker.send(rover.encode(m.Statustext(4, b"number %d" % number)))
        talker.send(other.encode(m.Statustext(4, b"me too")))
        running.server.wait_for("rover 43 says: me too")
        running.server.end()
        text, name = running.server.text, stranger.getsockname()[1]
    lines = re.findall(LINE, text)
    assert lines[:10] == [
        *(f"{level} rover 42 says: of {number}" for number, level in enumerate(LEVELS)),
        f"ERROR rover 42 says: {'a' * 50}{'b' * 30}",
        "WARNING rover 42, component 154, says: [31mhot ERROR forged",  # no order to a terminal
    ]
    assert len([line for line in lines if "says: number" in line]) < 100
    assert re.search(rf"bytes came from 127.0.0.1:{name} in \d+ s, and not one whole", text)
