"""What was measured of a rover beforehand: used for that very rover, and for no other."""

from dataclasses import replace
from functools import partial

from mav_tasks.config.settings import Settings, VehicleProfile
from mav_tasks.tasks.events import VehicleNoted, VehicleSeen
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Persona
from tests.kit.bodies import WeakBrakes
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, DENIED, DRIVE
from tests.kit.px4 import PROMPT_PX4
from tests.kit.world import PROMPT, World, near_pose
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_fence import YARD, fenced

TURNING = replace(PROMPT_PX4, honours_yaw_rate=True)
PX4_PROFILE = VehicleProfile(
    system_id=1,
    uid="1",
    autopilot="px4",
    firmware="1.17.0 99c40407",
    probed="2026-11-20T10:00:00Z",
    yaw_rate="honoured",
)
ARDUPILOT_PROFILE = VehicleProfile(
    system_id=1,
    uid="1",
    autopilot="ardupilot",
    firmware="4.6.3 3fc7011a",
    probed="2026-11-20T10:00:00Z",
)


def known(*profiles: VehicleProfile) -> Settings:
    return Settings(profiles=profiles)


def noted(world: World) -> list[str]:
    events: list[VehicleNoted | VehicleSeen] = [
        *world.events(VehicleNoted),
        *world.events(VehicleSeen),
    ]
    events.sort(key=lambda event: event.at)
    return [event.text for event in events if "profile" in event.text]


def rotate(world: World, angle: float = 90.0) -> tuple[int, int] | None:
    sent = world.client.rotate(angle)
    world.run(0.3)
    return sent.answer


def reverse(world: World) -> tuple[int, int] | None:
    """Ask for what only one does that honours a yaw rate."""
    sent = world.client.command(DRIVE, -0.5, 0.0, 1.0)
    world.run(0.3)
    return sent.answer


def test_a_px4_that_was_measured_to_turn_is_turned(make_world: MakeWorld) -> None:
    world = make_world(persona=TURNING, settings=known(PX4_PROFILE))
    assert rotate(world) == (ACCEPTED, 1)
    world.until_idle(tasks=1)
    assert world.state(1)[0] is S.COMPLETED
    assert near_pose(world.pose(), (0, 0, 90))
    assert world.client.move(-0.5)
    world.until_idle(tasks=2)
    assert near_pose(world.pose(), (0, -0.5, 90))
    assert noted(world) == ["uses the profile of 2026-11-20"]
    assert world.client.said("uses the profile of 2026-11-20")


@for_each(
    "change_of, words",
    [
        ({"uid": "2"}, "ignores the profile: it is of another rover"),
        ({"firmware": "1.14.0 99c40407"}, "ignores the profile: it is of firmware 1.14.0 99c40407"),
        ({"autopilot": "generic"}, "ignores the profile: it is of generic"),
    ],
)
def test_a_profile_of_something_else_is_told_and_not_used(
    make_world: MakeWorld, change_of: dict[str, str], words: str
) -> None:
    profile = replace(PX4_PROFILE, **change_of)  # type: ignore[arg-type]
    world = make_world(persona=TURNING, settings=known(profile))
    assert reverse(world) == (DENIED, R.NOT_SUPPORTED_BY_VEHICLE)
    assert noted(world) == [words]


@for_each(
    "persona, profile, answer",
    [
        (TURNING, PX4_PROFILE, (ACCEPTED, 1)),
        (
            PROMPT,
            replace(ARDUPILOT_PROFILE, yaw_rate="ignored"),
            (DENIED, R.NOT_SUPPORTED_BY_VEHICLE),
        ),
    ],
)
def test_what_was_measured_of_turning_decides_who_reverses(
    make_world: MakeWorld, persona: Persona, profile: VehicleProfile, answer: tuple[int, int]
) -> None:
    assert reverse(make_world(persona=persona, settings=known(profile))) == answer


def test_a_rover_that_was_seen_not_to_stop_by_itself_is_not_driven(make_world: MakeWorld) -> None:
    world = make_world(settings=known(replace(ARDUPILOT_PROFILE, loss_stop="no")))
    sent = world.client.move(1.0)
    world.run(3.0)
    assert sent.answer == (ACCEPTED, 1)
    assert world.client.said("does not stop without setpoints")
    assert (world.is_armed, world.truth.north) == (False, 0.0)


class TestBrakes:
    """A rover that brakes at 0.2 m/s², where 0.5 is planned for."""

    body = staticmethod(partial(WeakBrakes, braking=0.2))

    def farthest(self, make_world: MakeWorld, settings: Settings) -> float:
        world = make_world(body=self.body, settings=settings)
        assert fenced(world, *YARD) == 0
        world.client.command(DRIVE, 2.0, 0, 30, 0, 0, 0, 5)
        world.until_state(1, S.HELD)
        world.until(world.stands, within=20)
        return world.truth.north

    def test_what_was_measured_keeps_it_inside_its_fence(self, make_world: MakeWorld) -> None:
        measured = replace(ARDUPILOT_PROFILE, speed=1.0, stopping_distance=2.6, stopping_time=5.2)
        assert self.farthest(make_world, Settings()) > 3.0, "without, it would be no test"
        assert 1.0 < self.farthest(make_world, known(measured)) < 3.1
