"""What a rover measures of itself is wrong: how far it drives at the most until that is seen."""

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, hypot, nan, pi, radians, sin

from mav_tasks.config.settings import Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.body import Body, Pose
from rover_sim.faults import Faults
from rover_sim.kinematic import KinematicBody
from rover_sim.personas import Mode, Persona
from tests.kit import px4
from tests.kit.cases import for_each
from tests.kit.world import PROMPT, World, at, near_pose
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_fence import INCLUSION, box, fenced

DRIVE, REPOSITION = 54002, 192
SLOW, FAST = 0.5, 2.0  # m/s
#: m from where it was that it drives at the most: half a metre the wrong way, and what it takes to
#: stop from the speed that it has by then
WRONG = {SLOW: 0.9, FAST: 1.3}
RUNS_AWAY = 6.0  # m; if its wheels turn the wrong way, its own speed loop speeds it up until HOLD
#: the same of one whose position stands: a metre is asked for
BLIND = {SLOW: 1.4, FAST: 2.0}
#: the same where it has its full speed when that begins, with 2.7 m to stop
BLIND_AT_SPEED = {SLOW: 1.6, FAST: 4.5}
STANDS = 4.0  # s, from the end of a task to standing

Start = Callable[[World, float], object]
GOALS: dict[str, Start] = {
    "move": lambda w, speed: w.client.move(20, speed=speed),
    "drive": lambda w, speed: w.client.command(DRIVE, speed, 0, 60),
    "go to": lambda w, speed: w.client.command_int(
        REPOSITION, speed, 0, 0, nan, **at(20, 0), frame=6
    ),
}
MAKES: dict[str, Persona] = {"ardupilot": PROMPT, "px4": px4.PROMPT_PX4}


@dataclass
class Way:
    """How far a rover gets from where it is now."""

    world: World
    furthest: float = 0.0

    def __post_init__(self) -> None:
        self._north, self._east, _ = self.world.pose()
        self.world.watch(self._look)

    def _look(self, _now: float) -> None:
        truth = self.world.truth
        away = hypot(truth.north - self._north, truth.east - self._east)
        self.furthest = max(self.furthest, away)


def driving(world: World, goal: str, speed: float) -> World:
    """A rover at full speed on a task, another task waits."""
    GOALS[goal](world, speed)
    world.until_faster(0.95 * speed, within=15)
    world.client.rotate(90)
    world.run(0.2)
    return world


def is_over(world: World) -> bool:
    return world.state(1)[0] in (S.HELD, S.FAILED)


def nothing_follows(world: World) -> None:
    """The rover stands in HOLD, the next task does not begin."""
    world.until(world.stands, within=STANDS)
    world.run(5)
    assert world.stands()
    assert world.mode() is Mode.HOLD
    assert len(world.tasks()) == 1 or world.state(2)[0] is S.QUEUED


OPPOSITE = [
    (180.0, make, goal, speed) for make in MAKES for goal in GOALS for speed in (SLOW, FAST)
]
ACROSS = [(90.0, make, "move", FAST) for make in MAKES] + [(-90.0, "ardupilot", "drive", FAST)]


@for_each("error, make, goal, speed", OPPOSITE[::2] + ACROSS)
def test_a_wrong_heading_is_found_within_half_a_metre(
    make_world: MakeWorld, error: float, make: str, goal: str, speed: float
) -> None:
    world = make_world(persona=MAKES[make], settings=Settings(on_failure="continue"))
    world.fault(Faults(heading_error=radians(error)))
    world.run(0.5)
    way = Way(world)
    GOALS[goal](world, speed)
    world.until(lambda: is_over(world), within=20)
    world.client.rotate(90)
    assert world.state(1) == (S.HELD, R.OFF_TRACK)
    nothing_follows(world)
    assert way.furthest < WRONG[speed]
    assert world.client.said("check its heading")


@for_each("speed", [SLOW, FAST])
def test_wheels_that_turn_the_wrong_way_are_found_within_half_a_metre(
    make_world: MakeWorld, speed: float
) -> None:
    class Reversed(KinematicBody):
        def drive(self, forward_speed: float, yaw_rate: float) -> None:
            super().drive(-forward_speed, yaw_rate)

    def body(start: Pose) -> Body:
        return Reversed(start=start, slip=0.1, seed=None)

    world = make_world(body=body)
    way = Way(world)
    world.client.move(20, speed=speed)
    world.until(lambda: is_over(world), within=20)
    assert world.state(1) == (S.HELD, R.OFF_TRACK)
    assert way.furthest < WRONG[speed]
    world.until(lambda: world.rover.autopilot.mode is Mode.HOLD, within=0.8)
    nothing_follows(world)
    assert way.furthest < RUNS_AWAY


@for_each("speed, beside", [(SLOW, 1.3), (FAST, 2.2)])
def test_a_heading_that_steering_cannot_make_up_for_is_found_a_metre_beside_the_line(
    make_world: MakeWorld, speed: float, beside: float
) -> None:
    world = make_world()
    world.fault(Faults(heading_error=radians(50)))
    world.run(0.5)
    furthest = 0.0

    def look(_now: float) -> None:
        nonlocal furthest
        truth, yaw = world.truth, radians(50)
        furthest = max(furthest, abs(truth.east * cos(yaw) - truth.north * sin(yaw)))

    world.watch(look)
    world.client.move(20, speed=speed)
    world.until(lambda: is_over(world), within=30)
    assert world.state(1) == (S.HELD, R.OFF_TRACK)
    nothing_follows(world)
    assert 1.0 < furthest < beside


@for_each("turned", [180, -90, 60])
@for_each("goal", GOALS)
def test_a_heading_that_jumps_holds_the_task_at_once(
    world: World, goal: str, turned: float
) -> None:
    driving(world, goal, SLOW)
    way = Way(world)
    since = world.now
    world.fault(Faults(heading_error=radians(turned)))
    world.until(lambda: is_over(world), within=0.2)
    assert world.state(1) == (S.HELD, R.FRAME_RESET)
    assert "move" not in world.observer.sent_since(since + 0.2)
    nothing_follows(world)
    assert way.furthest < 0.3


@for_each("jump", [(1.9, 0.0), (-0.9, 0.0), (0.0, 1.9)])
def test_a_jump_below_2_m_is_a_correction_that_is_driven_by(
    world: World, jump: tuple[float, float]
) -> None:
    driving(world, "move", SLOW)
    top = 0.0

    def look(_now: float) -> None:
        nonlocal top
        top = max(top, abs(world.truth.forward_speed))

    world.watch(look)
    world.fault(Faults(position_jump=jump))
    world.until_state(1, S.COMPLETED, within=60)
    world.until_idle(tasks=2)
    north, east = jump
    assert near_pose(world.pose(), (20 - north, -east, 90.0))
    assert top < SLOW + 0.05


STANDING = [("ardupilot", goal, speed) for goal in ("move", "drive") for speed in (SLOW, FAST)]


@for_each("make, goal, speed", [*STANDING, ("px4", "drive", FAST)])
def test_a_position_that_stands_from_the_beginning_ends_the_task_after_a_metre(
    make_world: MakeWorld, make: str, goal: str, speed: float
) -> None:
    world = make_world(persona=MAKES[make])
    world.fault(Faults(position_frozen=True))
    world.run(0.5)
    way = Way(world)
    GOALS[goal](world, speed)
    world.until(lambda: is_over(world), within=20)
    world.client.rotate(90)
    assert (world.state(1), world.paused()) == ((S.FAILED, R.STUCK), R.STUCK)
    nothing_follows(world)
    assert way.furthest < BLIND[speed]


@for_each("speed", [SLOW, FAST])
@for_each("goal", ["move", "drive"])
def test_a_rover_that_says_that_it_stands_while_it_drives_is_stopped_after_a_metre(
    make_world: MakeWorld, speed: float, goal: str
) -> None:
    world = driving(make_world(), goal, speed)
    way = Way(world)
    world.fault(Faults(position_frozen=True, says_it_stands=True))
    world.until(lambda: is_over(world), within=20)
    assert (world.state(1), world.paused()) == ((S.FAILED, R.STUCK), R.STUCK)
    nothing_follows(world)
    assert way.furthest < BLIND_AT_SPEED[speed]


#: m from where it was when that began, at the most, braking included; by speed
LOSSES = {
    "position stands": (Faults(position_frozen=True), {SLOW: 0.55, FAST: 3.3}),
    "no telemetry": (Faults(withheld=frozenset(range(1, 512))), {SLOW: 0.55, FAST: 3.3}),
    "not a number": (Faults(not_finite=True), {SLOW: 0.55, FAST: 3.3}),
    "clock stands": (Faults(clock_frozen=True), {SLOW: 0.55, FAST: 3.3}),
    "jump": (Faults(position_jump=(50.0, 0.0)), {SLOW: 0.45, FAST: 3.0}),
    "no heartbeats": (Faults(withheld=frozenset({0})), {SLOW: 2.2, FAST: 10.0}),
}


@for_each("speed", [SLOW, FAST])
@for_each("what", LOSSES)
def test_what_is_lost_stops_it_within_so_many_metres(
    make_world: MakeWorld, what: str, speed: float
) -> None:
    world = driving(make_world(), "move", speed)
    faults, metres = LOSSES[what]
    way = Way(world)
    world.fault(faults)
    world.until(lambda: world.state(1)[0] in (S.PAUSED, S.HELD), within=4.5)
    world.until(world.stands, within=STANDS)
    world.run(3)
    assert world.stands()
    assert 0.0 < way.furthest < metres[speed]


def test_a_heading_that_stands_while_it_turns_ends_the_turn_after_a_radian(world: World) -> None:
    world.fault(Faults(heading_frozen=True))
    world.client.rotate(350)
    world.until(lambda: is_over(world), within=20)
    assert world.state(1) == (S.FAILED, R.STUCK)
    nothing_follows(world)
    # the rover itself does not see that it turns, and turns faster than it is told
    told = sum(abs(getattr(m, "yaw_rate", 0.0)) for _, m in world.observer.driven) * 0.05
    assert 0.5 < told < 1.7


@for_each("speed", [SLOW, FAST])
def test_a_wrong_heading_leads_over_a_fence_no_further_than_anywhere(
    world: World, speed: float
) -> None:
    """It looks for room where it believes to be driving to."""
    assert fenced(world, *box(INCLUSION, -50, -50, 0.2, 50)) == 0
    world.fault(Faults(heading_error=pi))
    world.run(0.5)
    world.client.command(DRIVE, speed, 0, 60)
    world.until(lambda: is_over(world), within=20)
    assert world.state(1) in ((S.HELD, R.OFF_TRACK), (S.HELD, R.FENCE))
    nothing_follows(world)
    assert world.truth.north < WRONG[speed]
