"""The commands of a plan: driven, sent at their place, skipped and said once, or refused."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import atan2, hypot, remainder, tau
from typing import NamedTuple

import pytest

from mav_tasks.config.settings import Settings, VehicleProfile
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Persona
from tests.kit.car import Car
from tests.kit.cases import anew, for_each
from tests.kit.px4 import PROMPT_PX4
from tests.kit.rows import check, item
from tests.kit.world import PROMPT, World, is_at
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_profiles import ARDUPILOT_PROFILE

SERVO = 183
ARDUPILOT_CAR = replace(ARDUPILOT_PROFILE, turning="steered", turning_radius=1.2)
NOON = 1_800_014_400.0 + 43_200.0 - (1_800_014_400.0 % 86_400.0)


class Seen(NamedTuple):
    """What was truly driven, look after look."""

    north: float
    east: float
    speed: float  # forward, m/s
    at: float


def driven(world: World, plan: str) -> list[Seen]:
    """Upload a plan, drive it to its end, and return how the rover truly went."""
    upload = world.upload(
        [item(each.replace("TO=", "NAV_WAYPOINT at=")) for each in plan.split("; ")],
        target=(1, 191),
    )
    assert upload.result == 0, world.client.texts()
    track: list[Seen] = []

    def is_over() -> bool:
        truth = world.truth
        track.append(Seen(truth.north, truth.east, truth.forward_speed, world.now))
        return world.state(upload.opaque_id)[0] is S.COMPLETED

    world.until(is_over, within=90.0)
    return track


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
    track = driven(world, f"NAV_LOITER_TURNS 1 0 {radius} 0 at=3,0")
    turned = turned_round(track, 3, 0, within=abs(radius) + 0.4)
    assert 0.9 * tau < turned * (1 if radius > 0 else -1) < 1.2 * tau
    assert max(seen.north for seen in track) == pytest.approx(3 + abs(radius), abs=0.25)
    assert hypot(world.truth.north - 3, world.truth.east) == pytest.approx(abs(radius), abs=0.25)


@for_each("profile", [None, ARDUPILOT_CAR])
def test_what_is_to_be_driven_backwards_is(
    make_rover: MakeRover, profile: VehicleProfile | None
) -> None:
    world = make_rover(PROMPT, profile)
    backwards, forwards = (f"DO_SET_REVERSE {n} 0 0 0 frame=2" for n in (1, 0))
    track = driven(world, f"TO=2,0; {backwards}; TO=0.5,0.2; TO=-1.5,0; {forwards}; TO=1,0")
    turned = max(range(len(track)), key=lambda n: track[n].north)
    ended = min(range(len(track)), key=lambda n: track[n].north)
    way = track[turned:ended]
    assert len(way) > 50
    assert sum(seen.speed < 0.02 for seen in way) > 0.95 * len(way)
    assert min(seen.speed for seen in way) < -0.3
    assert max(seen.speed for seen in track[ended:]) > 0.3
    assert hypot(world.truth.north - 1, world.truth.east) < 0.2


@for_each("params, until", [("0 12 0 9", 9.0), ("-1 -1 -1 8", 8.0)])
def test_it_stands_until_a_time_of_day(make_world: MakeWorld, params: str, until: float) -> None:
    world = make_world(wall_offset=NOON)
    track = driven(world, f"NAV_DELAY {params} frame=2; TO=0.5,0")
    moved_at = next(seen.at for seen in track if hypot(seen.north, seen.east) > 0.05)
    assert until < moved_at < until + 2.5


@for_each("persona, wish, speed", [(PROMPT, 0.0, 0.3), (PROMPT_PX4, -1.0, 0.5)])
def test_no_speed_means_what_it_means_to_the_autopilot(
    make_world: MakeWorld, persona: Persona, wish: float, speed: float
) -> None:
    world = make_world(persona=persona)
    slow, same = (f"DO_CHANGE_SPEED 1 {each} 0 frame=2" for each in ("0.3 0", f"{wish} 50"))
    track = driven(world, f"{slow}; TO=1,0; {same}; TO=4,0")
    late = [seen.speed for seen in track if 2 < seen.north < 3]
    assert max(late) == pytest.approx(speed, abs=0.08)


def test_a_gate_holds_back_a_command_until_it_is_passed(world: World) -> None:
    sent: list[float] = []

    def look(_now: float) -> None:
        if not sent and str(SERVO) in world.observer.sent_since(0):
            sent.append(world.truth.north)

    world.watch(look)
    driven(world, "TO=1,0; CONDITION_GATE at=2,0; DO_SET_SERVO 9 1700 0 0 frame=2; TO=3,0")
    assert sent == [pytest.approx(2.0, abs=0.2)]
    assert world.observer.sent_since(0).count(str(SERVO)) == 1


def test_what_is_skipped_is_said_once(world: World) -> None:
    driven(world, "NAV_TAKEOFF; TO=1,0; NAV_SPLINE_WAYPOINT at=9,9; NAV_LAND at=9,9")
    said = [text for text in world.client.texts() if "skips" in text]
    assert len(said) == 1
    assert (
        "it skips item 1 (22 NAV_TAKEOFF), 3 (82 NAV_SPLINE_WAYPOINT), 4 (21 NAV_LAND)" in said[0]
    )
    assert is_at(world, 1.0, 0.0)


def test_what_is_refused_is_told_with_the_reason(world: World) -> None:
    check(
        world,
        """
plan; FIRST; DO_SET_MODE 1 END : UNSUPPORTED is not for a plan: the server starts, stops and arms
plan; FIRST; DO_REPOSITION 1 END : UNSUPPORTED see 16
plan; FIRST; PREFLIGHT_REBOOT_SHUTDOWN 1 END : UNSUPPORTED never on the way
plan; FIRST; ARM_IT 1 END : UNSUPPORTED as the last item NAV_RETURN_TO_LAUNCH (20) disarms it
plan; FIRST; SET_MESSAGE_INTERVAL 1 END : UNSUPPORTED nobody would hear the answer
plan; FIRST; DO_ORBIT 1 END : UNSUPPORTED write NAV_WAYPOINT (16) or NAV_LOITER_TURNS (18)
plan; FIRST; DO_SET_PARAMETER 1 END : UNSUPPORTED do that before the plan
plan; FIRST; TASK_STOP 1 END : UNSUPPORTED out, or send it as a command
plan; FIRST; 777 1 END : UNSUPPORTED 777 is not for a plan
""".replace("FIRST", "NAV_WAYPOINT at=1,0")
        .replace("ARM_IT", "COMPONENT_ARM_DISARM")
        .replace("END", "0 0 0 frame=2"),
    )
