"""What viewers draw of a recording: poses, places, set-points, texts and tasks."""

import json
from math import nan, pi, sqrt
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mcap", reason="the extra mcap is not installed")

from mcap.reader import make_reader

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.messages import Message
from mav_tasks.recording.mcap_export.exporting import export
from tests.unit.recording.mcap_export.test_round_trip import check_messages, json_of, stamped

ROVER, SERVER = Address(1, 1), Address(250, 191)
START = 1_763_726_400_000_000  # us
SECOND = 1_000_000
Sent = Message | tuple[int, Message]  # some us after START

#: as Foxglove's documentation has them: the fields that a message must have
FOXGLOVE = {
    "foxglove.PoseInFrame": "timestamp frame_id pose",
    "foxglove.LocationFix": "timestamp frame_id latitude longitude altitude position_covariance"
    " position_covariance_type",
    "foxglove.Log": "timestamp level message name file line",
}


def attitude(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Message:
    return m.Attitude(0, roll, pitch, yaw, 0.0, 0.0, 0.0)


def position(north: float, east: float, down: float) -> Message:
    return m.LocalPositionNed(0, north, east, down, 0.0, 0.0, 0.0)


def seen(folder: Path, *sent: Sent, source: Address = ROVER) -> list[tuple[str, Any]]:
    """Export a log of messages; return what viewers find beside the messages themselves."""
    timed = [each if isinstance(each, tuple) else (n, each) for n, each in enumerate(sent)]
    encoder, log, out = Encoder(source), folder / "log.tlog", folder / "out.mcap"
    log.write_bytes(b"".join(stamped(encoder.encode(each), START + at) for at, each in timed))
    with out.open("wb") as file:
        export([log], file)
    check_messages(out)
    with out.open("rb") as file:
        for schema, _, _ in make_reader(file).iter_messages():
            if schema and schema.name in FOXGLOVE:
                fields = json.loads(schema.data)["properties"]
                assert set(fields) == set(FOXGLOVE[schema.name].split())
    own = {topic: found for topic, found in json_of(out).items() if topic[:9] != "/mavlink/"}
    return [(topic, values) for topic, found in own.items() for values in found]


def turned(q: dict[str, float], vector: tuple[float, float, float]) -> list[float]:
    """Turn a vector by a quaternion, by the textbook's matrix."""
    x, y, z, w = (q[part] for part in "xyzw")
    rows = [
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    ]
    return [round(sum(a * b for a, b in zip(row, vector, strict=True)), 6) + 0.0 for row in rows]


def test_a_pose_is_drawn_as_the_rover_stands(tmp_path: Path) -> None:
    forward, left, up = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    half = round(sqrt(0.5), 6)
    for angles, axis, points in (
        ({"yaw": 0.0}, forward, [0, 1, 0]),  # east, north, up
        ({"yaw": pi / 2}, forward, [1, 0, 0]),
        ({"yaw": pi / 2}, left, [0, 1, 0]),
        ({"yaw": 1.0}, up, [0, 0, 1]),
        ({"pitch": pi / 4}, forward, [0, half, half]),  # nose up
        ({"roll": pi / 4}, left, [-half, 0, half]),  # the right side down
        ({"roll": pi / 4, "yaw": pi / 2}, left, [0, half, half]),
    ):
        ((topic, pose),) = seen(tmp_path, attitude(**angles), position(3.0, -2.0, 0.5))
        assert (topic, pose["frame_id"]) == ("/rover/1/pose", "rover/1/local")
        assert pose["timestamp"] == {"sec": 1_763_726_400, "nsec": 1000}
        assert pose["pose"]["position"] == {"x": -2.0, "y": 3.0, "z": -0.5}
        drawn = turned(pose["pose"]["orientation"], axis)
        assert drawn == pytest.approx(points, abs=1e-6), angles


def test_what_is_not_known_is_not_drawn(tmp_path: Path) -> None:
    assert len(seen(tmp_path, attitude(), (SECOND, position(1, 2, 3)))) == 1
    for source, sent in (
        (ROVER, [position(1, 2, 3)]),
        (ROVER, [attitude(), (SECOND + 1, position(1, 2, 3))]),
        (ROVER, [attitude(roll=nan), position(1, 2, 3)]),
        (Address(1, 191), [attitude(), position(1, 2, 3)]),  # no autopilot
        (ROVER, [m.GlobalPositionInt(0, 0, 0, 0, 0, 0, 0, 0, 0)]),
        (ROVER, [m.GpsRawInt(0, 1, 10, 20, 30, 0, 0, 0, 0, 9)]),
    ):
        assert seen(tmp_path, *sent, source=source) == [], sent


def test_places_of_estimate_and_receiver(tmp_path: Path) -> None:
    place = m.GlobalPositionInt(0, -353_632_620, 1_491_652_370, 584_120, 0, 0, 0, 0, 0)
    raw = m.GpsRawInt(0, 3, 10, 20, 30, 0, 0, 0, 0, 9, 0, 1500, 2000)
    (where, found), (receiver, fix) = seen(tmp_path, place, raw)
    assert (where, receiver) == ("/rover/1/location", "/rover/1/gps")
    del found["timestamp"]
    assert found.pop("position_covariance") == [0] * 9
    assert found == {
        "frame_id": "rover/1",
        "latitude": -35.363262,
        "longitude": 149.165237,
        "altitude": 584.12,
        "position_covariance_type": 0,
    }
    assert fix["position_covariance"] == [2.25, 0, 0, 0, 2.25, 0, 0, 0, 4.0]
    assert fix["position_covariance_type"] == 1


def test_long_texts_are_joined_and_levels_are_foxgloves(tmp_path: Path) -> None:
    first, second = b"x" * 50, b"the rest"
    texts = [m.Statustext(4, first, 7, 0), m.Statustext(4, second, 7, 1)]
    ((topic, text),) = seen(tmp_path, *texts)
    words = (first + second).decode()
    assert (topic, text["message"], text["level"], text["name"]) == ("/texts", words, 3, "1/1")
    levels = seen(tmp_path, *(m.Statustext(severity, b"x") for severity in range(8)))
    assert [text["level"] for _, text in levels] == [5, 5, 5, 4, 3, 2, 2, 1]
    for sent in ([texts[0]], [texts[0], (3 * SECOND, m.Heartbeat(6, 8, 0, 0, 4, 3))]):
        ((_, late),) = seen(tmp_path, *sent)  # that never becomes whole
        assert late["message"] == "x" * 50 + "[…]"
