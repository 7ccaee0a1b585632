"""A plan of 60 items on slipping wheels: every place is passed by the rover as it really is."""

from math import hypot, nan
from time import perf_counter

import pytest

from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.bullet import BulletBody
from tests.kit.client import ACCEPTED
from tests.kit.mission import REACHED, Item, Upload
from tests.kit.world import World, at

pytestmark = pytest.mark.pybullet

WAYPOINT, LOITER_TIME, DELAY, SPEED, JUMP, START = 16, 19, 93, 178, 177, 300
RADIUS = 0.4  # m, of each waypoint
SEED = 1
LANES, LENGTH, APART = 11, 3.0, 1.0  # m


def speed(wish: float) -> Item:
    return Item(SPEED, param1=1, param2=wish, param3=-1, frame=2, z=nan)


def survey() -> tuple[list[Item], dict[int, tuple[float, float]], list[int]]:
    """Return 60 items, the place in metres of each that is driven to, and the order of all."""
    items = [Item(WAYPOINT, frame=0, current=1)]
    places: dict[int, tuple[float, float]] = {}

    def place(north: float, east: float, command: int = WAYPOINT, *, wait: float = 0.0) -> None:
        places[len(items)] = north, east
        radius = RADIUS if command == WAYPOINT else 0.0
        items.append(Item(command, **at(north, east), param1=wait, param2=radius))

    for lane in range(LANES):
        along = (0.0, 1.0, 2.0, LENGTH)
        items.append(speed(1.0 if lane % 2 else 0.7))
        for north in along if lane % 2 == 0 else reversed(along):
            place(north, APART * lane + 1.0)
    place(2.0, 12.0, LOITER_TIME, wait=1.0)
    items.append(Item(DELAY, param1=1.5, frame=2))
    first = len(items)
    place(3.0, 12.0)
    items.append(Item(JUMP, param1=first - 2, param2=2, frame=2))
    loop = [first - 2, first - 1, first]
    return items, places, [*range(1, first - 2), *loop * 3]


@pytest.mark.slow
@pytest.mark.timeout(120)
def test_a_survey_of_60_items_passes_every_place_in_order() -> None:
    began = perf_counter()
    world = World(
        seed=SEED, body=lambda start: BulletBody(start=start, variation=0.3, seed=SEED)
    ).ready()
    items, places, expected = survey()
    assert len(items) == 60
    upload = Upload(world.client, items)
    world.until(lambda: upload.result is not None, within=10)
    assert upload.result == 0
    started = world.client.command(START, target=(1, 1))

    done: list[int] = []
    passed: list[int] = []  # of the places, those that the rover really came near, in their order
    order = [seq for seq in expected if seq in places]
    read = len(world.client.received)

    def look(_now: float) -> None:
        nonlocal read
        done.extend(
            int.from_bytes(packet.payload[:2], "little")
            for packet in world.client.received[read:]
            if packet.message_id == REACHED
        )
        read = len(world.client.received)
        if len(passed) < len(order):
            north, east = places[order[len(passed)]]
            if hypot(world.truth.north - north, world.truth.east - east) <= RADIUS:
                passed.append(order[len(passed)])
        said = [seq for seq in done[-1:] if seq in places]
        assert said == [] or done.count(said[0]) <= passed.count(said[0]), f"{said} not passed"

    world.watch(look)
    world.until_idle(tasks=1, within=600)
    took = perf_counter() - began
    print(f"seed {SEED}: {world.now:.0f} s driven in {took:.1f} s, {world.now / took:.0f} : 1")
    world.rover.body.close()
    world.check()
    assert started.result == ACCEPTED
    assert world.state(1)[0] is S.COMPLETED
    assert done == expected
    assert passed == order
    assert world.now > took, "slower than real time"
