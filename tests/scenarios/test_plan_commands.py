"""The commands of a plan: driven, sent at their place, skipped and said once, or refused."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import atan2, hypot, remainder, tau
from typing import NamedTuple

import pytest

from mav_tasks.settings import Settings, VehicleProfile
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Persona
from tests.kit.car import Car
from tests.kit.cases import anew, for_each
from tests.kit.mission import Item
from tests.kit.px4 import PROMPT_PX4
from tests.kit.world import PROMPT, World, at, is_at
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_profiles import ARDUPILOT_PROFILE

WAYPOINT, CIRCLE, LAND, TAKEOFF, SPLINE, DELAY, SPEED = 16, 18, 21, 22, 82, 93, 178
SERVO, REVERSE, GATE = 183, 194, 4501
ARDUPILOT_CAR = replace(ARDUPILOT_PROFILE, turning="steered", turning_radius=1.2)
NOON = 1_800_014_400.0 + 43_200.0 - (1_800_014_400.0 % 86_400.0)


def place(north: float, east: float) -> Item:
    return Item(WAYPOINT, **at(north, east))


def circle(north: float, east: float, *, turns: float, radius: float) -> Item:
    return Item(CIRCLE, **at(north, east), param1=turns, param3=radius, param4=0.0)


def do(command: int, *params: float) -> Item:
    p1, p2, p3, p4, *_ = (*params, 0.0, 0.0, 0.0, 0.0)
    return Item(command, 0, 0, p1, p2, p3, p4, frame=2)


class Seen(NamedTuple):
    """What was truly driven, look after look."""

    north: float
    east: float
    speed: float  # forward, m/s
    at: float


def driven(world: World, *items: Item, within: float = 90.0) -> list[Seen]:
    """Upload a plan, drive it to its end, and return how the rover truly went."""
    upload = world.upload(items, target=(1, 191))
    assert upload.result == 0, world.client.texts()
    track: list[Seen] = []

    def is_over() -> bool:
        truth = world.truth
        track.append(Seen(truth.north, truth.east, truth.forward_speed, world.now))
        return world.state(upload.opaque_id)[0] is S.COMPLETED

    world.until(is_over, within=within)
    return track


def refused(world: World, *items: Item) -> str:
    """Return why a plan was refused."""
    upload = world.upload(items, target=(1, 191))
    assert upload.result != 0
    world.run(0.2)
    return world.client.texts()[-1]


def turned_round(track: list[Seen], north: float, east: float, *, within: float) -> float:
    """Return the radians driven round a place, clockwise positive, while nearer than that."""
    turned, last = 0.0, None
    for seen in track:
        if hypot(seen.north - north, seen.east - east) > within:
            last = None
            continue
        angle = atan2(seen.east - east, seen.north - north)
        turned += 0.0 if last is None else remainder(angle - last, tau)
        last = angle
    return turned


MakeRover = Callable[[Persona, VehicleProfile | None], World]


@anew
def make_rover(make_world: MakeWorld) -> MakeRover:
    def make(persona: Persona, profile: VehicleProfile | None) -> World:
        if profile is None:
            return make_world(persona=persona)
        body = partial(Car, radius=1.2)
        return make_world(persona=persona, settings=Settings(profiles=(profile,)), body=body)

    return make


@for_each(
    "persona, profile, radius",
    [(PROMPT, None, 1.5), (PROMPT, ARDUPILOT_CAR, -2.0), (PROMPT_PX4, None, -1.5)],
)
def test_a_circle_is_driven_as_a_circle(
    make_rover: MakeRover, persona: Persona, profile: VehicleProfile | None, radius: float
) -> None:
    world = make_rover(persona, profile)
    track = driven(world, circle(3, 0, turns=1, radius=radius))
    turned = turned_round(track, 3, 0, within=abs(radius) + 0.4)
    assert 0.9 * tau < turned * (1 if radius > 0 else -1) < 1.2 * tau
    assert max(seen.north for seen in track) == pytest.approx(3 + abs(radius), abs=0.25)
    assert hypot(world.truth.north - 3, world.truth.east) == pytest.approx(abs(radius), abs=0.25)


@for_each("profile", [None, ARDUPILOT_CAR])
def test_what_is_to_be_driven_backwards_is(
    make_rover: MakeRover, profile: VehicleProfile | None
) -> None:
    world = make_rover(PROMPT, profile)
    back = (do(REVERSE, 1), place(0.5, 0.2), place(-1.5, 0), do(REVERSE, 0))
    track = driven(world, place(2, 0), *back, place(1, 0))
    turned = max(range(len(track)), key=lambda n: track[n].north)
    ended = min(range(len(track)), key=lambda n: track[n].north)
    way = track[turned:ended]
    assert len(way) > 50
    assert sum(seen.speed < 0.02 for seen in way) > 0.95 * len(way)
    assert min(seen.speed for seen in way) < -0.3
    assert max(seen.speed for seen in track[ended:]) > 0.3
    assert hypot(world.truth.north - 1, world.truth.east) < 0.2


@for_each("params, until", [((0, 12, 0, 9), 9.0), ((-1, -1, -1, 8), 8.0)])
def test_it_stands_until_a_time_of_day(
    make_world: MakeWorld, params: tuple[float, ...], until: float
) -> None:
    world = make_world(wall_offset=NOON)
    track = driven(world, do(DELAY, *params), place(0.5, 0))
    moved_at = next(seen.at for seen in track if hypot(seen.north, seen.east) > 0.05)
    assert until < moved_at < until + 2.5


@for_each("persona, wish, speed", [(PROMPT, 0.0, 0.3), (PROMPT_PX4, -1.0, 0.5)])
def test_no_speed_means_what_it_means_to_the_autopilot(
    make_world: MakeWorld, persona: Persona, wish: float, speed: float
) -> None:
    world = make_world(persona=persona)
    slow, same = do(SPEED, 1, 0.3), do(SPEED, 1, wish, 50)
    track = driven(world, slow, place(1, 0), same, place(4, 0))
    late = [seen.speed for seen in track if 2 < seen.north < 3]
    assert max(late) == pytest.approx(speed, abs=0.08)


def test_a_gate_holds_back_a_command_until_it_is_passed(world: World) -> None:
    sent: list[float] = []
    items = (place(1, 0), Item(GATE, **at(2, 0)), do(SERVO, 9, 1700), place(3, 0))
    upload = world.upload(items, target=(1, 191))

    def is_over() -> bool:
        if not sent and str(SERVO) in world.observer.sent_since(0):
            sent.append(world.truth.north)
        return world.state(upload.opaque_id)[0] is S.COMPLETED

    world.until(is_over, within=60)
    assert sent == [pytest.approx(2.0, abs=0.2)]
    assert world.observer.sent_since(0).count(str(SERVO)) == 1


def test_what_is_skipped_is_said_once(world: World) -> None:
    driven(world, Item(TAKEOFF), place(1, 0), Item(SPLINE, **at(9, 9)), Item(LAND, **at(9, 9)))
    said = [text for text in world.client.texts() if "skips" in text]
    assert len(said) == 1
    assert (
        "it skips item 1 (22 NAV_TAKEOFF), 3 (82 NAV_SPLINE_WAYPOINT), 4 (21 NAV_LAND)" in said[0]
    )
    assert is_at(world, 1.0, 0.0)


REFUSALS = {
    176: "176 DO_SET_MODE is not for a plan: the server starts, stops and arms the rover",
    192: "see 16",
    246: "never on the way",
    400: "as the last item NAV_RETURN_TO_LAUNCH (20) disarms it",
    511: "nobody would hear the answer",
    34: "write NAV_WAYPOINT (16) or NAV_LOITER_TURNS (18)",
    180: "do that before the plan",
    54003: "out, or send it as a command",
    777: "777 is not for a plan",
}


def test_what_is_refused_is_told_with_the_reason(world: World) -> None:
    for command, words in REFUSALS.items():
        assert words in refused(world, place(1, 0), do(command, 1))
