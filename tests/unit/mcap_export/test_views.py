from math import nan, pi, sqrt
from typing import Any

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.mavlink.messages import Message
from mav_tasks.mcap_export.views import SECOND, Seen, Views
from mav_tasks.services.statustext import chunks
from tests.unit.mcap_export.json_schema import check

ROVER, SERVER = Address(1, 1), Address(250, 191)
START = 1_763_726_400 * SECOND


def attitude(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Message:
    return m.Attitude(0, roll, pitch, yaw, 0.0, 0.0, 0.0)


def position(north: float, east: float, down: float) -> Message:
    return m.LocalPositionNed(0, north, east, down, 0.0, 0.0, 0.0)


def seen(*messages: Message, source: Address = ROVER, views: Views | None = None) -> list[Seen]:
    views = views or Views()
    found: list[Seen] = []
    for number, message in enumerate(messages):
        found += views.of(message, source, time=START + number)
    for each in found:
        check(each.values, each.schema.body, each.topic)
    return found


def turned(q: dict[str, float], vector: tuple[float, float, float]) -> list[float]:
    """Turn a vector by a quaternion, by the textbook's matrix."""
    x, y, z, w = (q[part] for part in "xyzw")
    rows = [
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    ]
    return [round(sum(a * b for a, b in zip(row, vector, strict=True)), 6) + 0.0 for row in rows]


FORWARD, LEFT, UP = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
EAST, NORTH, SKY = [1, 0, 0], [0, 1, 0], [0, 0, 1]
HALF = round(sqrt(0.5), 6)


@pytest.mark.parametrize(
    ("angles", "axis", "points"),
    [
        ({"yaw": 0.0}, FORWARD, NORTH),
        ({"yaw": pi / 2}, FORWARD, EAST),
        ({"yaw": pi / 2}, LEFT, NORTH),
        ({"yaw": 1.0}, UP, SKY),
        ({"pitch": pi / 4}, FORWARD, [0, HALF, HALF]),  # nose up
        ({"roll": pi / 4}, LEFT, [-HALF, 0, HALF]),  # the right side down
        ({"roll": pi / 4, "yaw": pi / 2}, LEFT, [0, HALF, HALF]),
    ],
)
def test_a_pose_is_drawn_as_the_rover_stands(
    angles: dict[str, float], axis: tuple[float, float, float], points: list[float]
) -> None:
    (pose,) = seen(attitude(**angles), position(3.0, -2.0, 0.5))
    assert (pose.topic, pose.schema.name) == ("/rover/1/pose", "foxglove.PoseInFrame")
    assert pose.values["frame_id"] == "rover/1/local"
    assert pose.values["timestamp"] == {"sec": 1_763_726_400, "nsec": 1}
    assert pose.values["pose"]["position"] == {"x": -2.0, "y": 3.0, "z": -0.5}
    assert turned(pose.values["pose"]["orientation"], axis) == pytest.approx(points, abs=1e-6)


def test_there_is_no_pose_without_a_recent_attitude() -> None:
    views = Views()
    assert seen(position(1, 2, 3), views=views) == []
    seen(attitude(), views=views)
    assert list(views.of(position(1, 2, 3), ROVER, time=START + SECOND)) != []
    assert list(views.of(position(1, 2, 3), ROVER, time=START + SECOND + 1)) == []
    assert list(views.of(position(1, 2, 3), Address(2, 1), time=START)) == []
    assert seen(attitude(roll=nan), position(1, 2, 3)) == []


def test_only_the_autopilot_is_drawn() -> None:
    assert seen(attitude(), position(1, 2, 3), source=Address(1, 191)) == []


def test_places_of_estimate_and_receiver() -> None:
    place = m.GlobalPositionInt(0, -353_632_620, 1_491_652_370, 584_120, 0, 0, 0, 0, 0)
    raw = m.GpsRawInt(0, 3, 10, 20, 30, 0, 0, 0, 0, 9, 0, 1500, 2000)
    where, receiver = seen(place, raw)
    assert (where.topic, receiver.topic) == ("/rover/1/location", "/rover/1/gps")
    assert {where.schema.name, receiver.schema.name} == {"foxglove.LocationFix"}
    assert [where.values[n] for n in ("latitude", "longitude", "altitude", "frame_id")] == [
        -35.363262,
        149.165237,
        584.12,
        "rover/1",
    ]
    assert where.values["position_covariance_type"] == 0
    assert receiver.values["position_covariance"] == [2.25, 0, 0, 0, 2.25, 0, 0, 0, 4.0]
    assert receiver.values["position_covariance_type"] == 1


def test_a_place_that_is_not_known_is_left_out() -> None:
    assert seen(m.GlobalPositionInt(0, 0, 0, 0, 0, 0, 0, 0, 0)) == []
    assert seen(m.GpsRawInt(0, 1, 10, 20, 30, 0, 0, 0, 0, 9)) == []


def test_a_setpoint_has_what_its_mask_says() -> None:
    target: dict[str, Any] = dict.fromkeys(("x", "y", "z", "afx", "afy", "afz"), 9.0)
    target |= {"vx": 0.5, "vy": 0.0, "vz": 0.0, "yaw": 9.0, "yaw_rate": -0.25}
    message = m.SetPositionTargetLocalNed(0, 2, 1, 8, 0b0101_1100_0111, **target)
    (setpoint,) = seen(message, source=SERVER)
    assert setpoint.topic == "/rover/2/setpoints/250/191"
    assert setpoint.values["frame"] == "BODY_NED"
    told = {name: value for name, value in setpoint.values.items() if value is not None}
    assert set(told) == {"timestamp", "frame", "vx", "vy", "vz", "yaw_rate"}
    assert (told["vx"], told["yaw_rate"]) == (0.5, -0.25)


def test_long_texts_are_joined_and_levels_are_foxgloves() -> None:
    words = "A text that is longer than one message has room for, and so comes in two"
    (text,) = seen(*chunks(MavSeverity.WARNING, words, text_id=7))
    assert (text.topic, text.schema.name) == ("/texts", "foxglove.Log")
    assert [text.values[name] for name in ("message", "level", "name")] == [words, 3, "1/1"]
    levels = [seen(m.Statustext(severity, b"x"))[0].values["level"] for severity in range(8)]
    assert levels == [5, 5, 5, 4, 3, 2, 2, 1]


def test_a_text_that_never_becomes_whole_is_told_at_last() -> None:
    first, _ = chunks(MavSeverity.INFO, "x" * 60, text_id=7)
    views = Views()
    assert list(views.of(first, ROVER, time=START)) == []
    (late,) = views.of(attitude(), ROVER, time=START + 3 * SECOND)
    assert late.values["message"] == "x" * 50 + "[…]"
    assert list(views.of(first, ROVER, time=START)) == []
    (last,) = views.rest(time=START + 1)
    assert last.time == START + 1
