"""A run's recordings as the map shows them: points, modes, texts and events."""

from pathlib import Path
from struct import pack
from typing import Any

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.web.recorded import Run
from tests.kit.rows import number
from tests.unit.recording.odd_packets import UNKNOWN, WRONG_CRC
from tests.unit.recording.test_record import recorded

#: seconds, component, a message
LOG = """0 1 Heartbeat 10 3 1 4 4 3
0 1 Heartbeat 10 3 129 15 4 3
0 1 Heartbeat 10 3 129 15 4 3
0 190 Heartbeat 6 8 0 0 4 3
0 191 Heartbeat 18 0 0 0 4 3
0 1 Heartbeat 10 9 1 9 4 3
0 1 LocalPositionNed 0 1 2 0 3 4 0
0 1 Attitude 0 0 0 1.5 0 0 0
0 1 Attitude 0 0 0 nan 0 0 0
0.1 1 LocalPositionNed 0 9 9 0 0 0 0
1 1 LocalPositionNed 0 nan 0 0 0 0 0
1 191 LocalPositionNed 0 9 9 0 0 0 0
1 1 LocalPositionNed 0 1 2.01 0 0 0 0
2 1 LocalPositionNed 0 1 3 0 0 0 0
7 1 LocalPositionNed 0 1 3 0 0 0 0
7.5 1 Statustext 4 Ready 0 0"""


def stamped(seconds: float, packet: bytes) -> bytes:
    return pack(">Q", round(seconds * 1e6)) + packet


def logged(row: str) -> bytes:
    at, component, kind, *fields = row.split()
    message = getattr(m, kind)(*map(number, fields))
    return stamped(float(at), Encoder(Address(1, int(component))).encode(message))


def shown(path: Path, *packets: bytes) -> Any:
    """Return what the map shows of a log of packets, or of a file that exists."""
    if packets:
        path.write_bytes(b"".join(packets))
    run = Run()
    run.add([path])
    return run.form()


def test_the_map_shows_points_modes_and_texts(tmp_path: Path) -> None:
    odd = stamped(0, UNKNOWN), stamped(0, WRONG_CRC)
    text = {"at": 7.5, "words": "Ready", "kind": "text", "vehicle": 1, "task": None}
    assert shown(tmp_path / "x.tlog", *map(logged, LOG.splitlines()), *odd) == {
        "begins": 0.0,
        "ends": 7.5,
        "vehicles": [
            {
                "vehicle": 1,
                "points": [[0, 1, 2, None, 5], [2, 1, 3, 85.9, 0], [7, 1, 3, 85.9, 0]],
                "modes": [[0, "HOLD", False], [0, "GUIDED", True], [0, "mode 9", False]],
            }
        ],
        "events": [text],
    }


def test_the_map_shows_a_long_run_with_fewer_points_and_events(tmp_path: Path) -> None:
    *_, place, text = (logged(row)[8:] for row in LOG.splitlines())
    points = [stamped(5 * n, place) for n in range(20_001)]
    long = shown(tmp_path / "x.tlog", *points, *[stamped(0, text)] * 5_001)
    (rover,) = long["vehicles"]
    assert [rover["points"][n][0] for n in (0, 1, -1)] == [0, 10, 100_000]
    assert len(long["events"]) == 5_000


def test_the_map_shows_the_events_of_a_record_of_decisions(tmp_path: Path) -> None:
    run = shown(recorded(tmp_path))
    assert run["vehicles"][0]["modes"][0][1:] == ["MANUAL", False]
    assert run["events"][-1]["words"] == "server stopped: no rover is being driven"
