from math import pi

import pytest

from mav_tasks.probe.driving_area import DrivingArea
from mav_tasks.tasks.driving.guidance import Motion
from mav_tasks.tasks.task import Pose

EAST = DrivingArea(Pose(10.0, 20.0, pi / 2))  # ahead is east, right is south


def moving(north: float, east: float, *, yaw: float = 0.0, forward: float = 0.0) -> Motion:
    return Motion(Pose(north, east, yaw), forward, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("motion", "is_held"),
    [
        (moving(10.0, 20.0), True),
        (moving(10.9, 20.9), True),
        (moving(11.1, 20.0), False),
        (moving(10.0, 18.9), False),
        (moving(10.0, 20.9, yaw=pi / 2, forward=0.1), True),
        (moving(10.0, 20.9, yaw=pi / 2, forward=0.3), False),  # it would be out before it stands
        (moving(10.0, 20.9, yaw=pi / 2, forward=-0.3), True),
        (moving(10.9, 20.0, yaw=0.0, forward=0.3), False),
    ],
)
def test_it_holds_what_is_inside_and_can_still_stop_there(motion: Motion, is_held: bool) -> None:
    assert EAST.holds(motion) is is_held


@pytest.mark.parametrize(
    ("north", "east", "course", "room"),
    [
        (10.0, 20.0, pi / 2, 1.0),
        (10.0, 20.4, pi / 2, 0.6),
        (10.0, 20.4, -pi / 2, 1.4),
        (10.0, 20.0, pi / 4, 2**0.5),
        (10.3, 20.0, 0.0, 0.7),
        (12.0, 20.0, 0.0, 0.0),
    ],
)
def test_the_room_to_a_side(north: float, east: float, course: float, room: float) -> None:
    assert EAST.room(Pose(north, east, 0.0), course) == pytest.approx(room)
