"""Random fences and tasks, at any speed up to the limit: no rover is ever really outside."""

from collections.abc import Callable
from math import cos, nan, pi, sin
from random import Random

from mav_tasks.config.settings import Driving
from mav_tasks.kinds import GlobalPlace, LocalPlace
from mav_tasks.links.memory import Conditions
from mav_tasks.tasks.driving.fence import Circle, Fence, LocalFence, Polygon
from rover_sim.geo import DEFAULT_ORIGIN
from rover_sim.personas import Persona
from tests.kit.cases import for_each
from tests.kit.client import DRIVE, MOVE
from tests.kit.mission import Item, Upload
from tests.kit.px4 import PROMPT_GENERIC, PROMPT_PX4
from tests.kit.volume import tries
from tests.kit.world import PROMPT, World, at
from tests.scenarios.conftest import MakeWorld

FENCE = 1
CORNER, CIRCLE_OUT, WAYPOINT, SPEED, START = 5001, 5004, 16, 178, 300
REPOSITION, HEAD, RELEASE, SKIP = 192, 213, 54013, 2
TASKS = 6
FASTEST = Driving().max_speed
PATIENT = (0.0, 0.5, 1.0, 1.5)  # s
ORIGIN = GlobalPlace(*DEFAULT_ORIGIN.to_global(0.0, 0.0))


def random_fence(random: Random) -> list[Item]:
    """A yard of any shape round the rover, with ponds in it."""
    count = random.randrange(3, 9)
    items = []
    for number in range(count):
        angle, far = 2 * pi * (number + random.uniform(-0.3, 0.3)) / count, random.uniform(1.5, 8)
        place = at(far * cos(angle), far * sin(angle))
        items.append(Item(CORNER, **place, param1=count, param4=0, frame=0))
    for _ in range(random.randrange(4)):
        radius, angle = random.uniform(0.2, 1.0), random.uniform(0, 2 * pi)
        far = radius + random.uniform(0.4, 5)
        place = at(far * cos(angle), far * sin(angle))
        items.append(Item(CIRCLE_OUT, **place, param1=radius, frame=0))
    return items


def drawn(items: list[Item]) -> LocalFence:
    corners = tuple(GlobalPlace(i.x, i.y) for i in items if i.command == CORNER)
    ponds = [GlobalPlace(i.x, i.y) for i in items if i.command == CIRCLE_OUT]
    radii = [i.param1 for i in items if i.command == CIRCLE_OUT]
    circles = [Circle(place, radius, False) for place, radius in zip(ponds, radii, strict=True)]
    return LocalFence(Fence((Polygon(corners, True), *circles)), ORIGIN)


def fenced(world: World, items: list[Item]) -> int | None:
    return world.upload(items, kind=FENCE).result


def tasks(world: World, random: Random) -> list[Callable[[], object]]:
    """Return what the rover may be asked for."""
    client = world.client

    def speed() -> float:
        return random.choice((0.3, 1.0, FASTEST))

    def place() -> dict[str, int]:
        return at(random.uniform(-6, 6), random.uniform(-6, 6))

    def plan() -> None:
        change = Item(SPEED, param1=1, param2=speed(), param3=-1, frame=2)
        Upload(client, [change, *(Item(WAYPOINT, **place()) for _ in range(3))])
        world.run(1)
        client.command(START, target=(1, 1), repeats=PATIENT)

    return [
        lambda: client.command(MOVE, random.uniform(0.5, 8), speed(), repeats=PATIENT),
        lambda: client.command(DRIVE, speed(), 0, random.uniform(1, 10), repeats=PATIENT),
        lambda: client.command(HEAD, random.uniform(0, 360), speed(), repeats=PATIENT),
        lambda: client.command_int(
            *(REPOSITION, speed(), 1, 0, nan),
            frame=6,
            repeats=PATIENT,
            x=place()["x"],
            y=place()["y"],
        ),
        plan,
    ]


@for_each("seed", range(tries(3, long=30)))
@for_each("persona", [PROMPT, PROMPT_PX4, PROMPT_GENERIC])
def test_no_rover_is_ever_outside(make_world: MakeWorld, persona: Persona, seed: int) -> None:
    random = Random(seed)
    net = Conditions(delay=random.choice((0.002, 0.05)), loss=random.choice((0.0, 0.05)))
    world = make_world(seed=seed, persona=persona, conditions=net)
    items = random_fence(random)
    while not drawn(items).allows(LocalPlace(0.0, 0.0)):
        items = random_fence(random)
    fence = drawn(items)
    # over a bad net the rover may not have it in time, and then it is refused
    assert any(fenced(world, items) == 0 for _ in range(20))
    moved = 0.0
    for _ in range(TASKS):
        random.choice(tasks(world, random))()
        end = world.now + 30
        world.run(1.0)
        while world.now < end and not (world.control() == "IDLE" and world.stands()):
            world.run(0.05)
            here = LocalPlace(world.truth.north, world.truth.east)
            moved = max(moved, abs(world.truth.forward_speed))
            assert fence.allows(here), (here, world.describe())
        for task in world.tasks():  # what came to the fence
            if task.state.name == "HELD":
                world.client.command(RELEASE, task.id, SKIP, repeats=PATIENT)
                world.run(0.6)
        world.client.proceed()
        world.run(0.3)
    assert moved > 0.2, "and it has driven"
