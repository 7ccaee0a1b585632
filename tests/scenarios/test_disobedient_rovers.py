"""A rover that drives faster than it is told to, or does not stop: HOLD, then disarming."""

from math import copysign

import pytest

from mav_tasks.config.settings import Settings, Watch
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.body import Pose
from rover_sim.kinematic import KinematicBody
from rover_sim.personas import Mode
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

TOO_FAST = 0.6  # m/s beyond twice what was asked for
LOOK = 0.02  # s


class Wilful(KinematicBody):
    """Its throttle sticks until it is told to stand, or it slows down no quicker than it likes."""

    def __init__(self, start: Pose) -> None:
        super().__init__(start=start, slip=0.0, seed=None)
        self.stuck = 0.0  # m/s, whatever the autopilot's speed loop does about it; 0: not
        self.brakes = 9.0  # m/s²
        self.told = 0.0
        self.drives = 0.0

    def drive(self, forward_speed: float, yaw_rate: float) -> None:
        self.told = forward_speed
        super().drive(self.drives, yaw_rate)

    def advance(self, duration: float) -> None:
        wanted = self.stuck or self.told if self.told else 0.0
        self.drives = max(wanted, self.drives - self.brakes * duration)
        super().drive(self.drives, 0.0)
        super().advance(duration)


def driven(
    make_world: MakeWorld, speed: float, settings: Settings | None = None
) -> tuple[World, Wilful]:
    bodies: list[Wilful] = []

    def body(start: Pose) -> Wilful:
        bodies.append(Wilful(start))
        return bodies[0]

    world = make_world(body=body, settings=settings)
    world.client.move(40.0 * copysign(1, speed), speed=abs(speed))
    world.until(lambda: world.truth.forward_speed / speed > 0.95, within=20)
    return world, bodies[0]


@pytest.mark.parametrize(("speed", "added"), [(0.1, 1.9), (0.5, 2.0), (1.0, 2.5), (0.5, 0.9)])
def test_one_that_is_much_too_fast_is_stopped_and_its_task_held(
    make_world: MakeWorld, speed: float, added: float
) -> None:
    world, body = driven(make_world, speed)
    body.stuck = speed + added
    most = 2 * speed + TOO_FAST
    if speed + added < most:
        world.run(4)
        assert world.state(1)[0] is S.EXECUTING, "a healthy rover overshoots"
        return
    world.until_faster(most + 0.05, within=3)
    world.until_state(1, S.HELD, within=0.6)
    assert world.state(1)[1] is R.OVERSPEED
    world.run(0.3)
    assert world.mode() is Mode.HOLD


@pytest.mark.parametrize(
    ("brakes", "disarm_after", "is_disarmed"),
    [(0.0, 2.0, True), (0.0, 0.0, False), (0.14, 2.0, False), (0.9, 2.0, False)],
)
def test_one_that_circles_on_in_hold_is_disarmed_and_one_that_rolls_out_is_not(
    make_world: MakeWorld, brakes: float, disarm_after: float, is_disarmed: bool
) -> None:
    settings = Settings(watch=Watch(disarm_moving=disarm_after))
    world, body = driven(make_world, 1.0, settings)
    body.brakes = brakes
    world.client.stop()
    world.until(lambda: world.mode() is Mode.HOLD, within=0.9)
    at = world.now
    for _ in range(300):
        world.run(LOOK)
        if not world.is_armed:
            break
    assert world.is_armed is not is_disarmed
    if is_disarmed:
        assert 1.8 < world.now - at < 2.4
