"""A more urgent task interrupts another, which then ends exactly where it would have ended."""

from math import hypot
from random import Random

from mav_tasks.config.settings import Queueing, Settings
from mav_tasks.tasks.events import TaskChanged
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.client import MOVE, ROTATE
from tests.kit.volume import tries
from tests.kit.world import World, near_pose
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_waiting import MODIFY, PREEMPTIBLE, PREEMPTIVE, START_DELAY, submit

GAP = Settings(queueing=Queueing(preemption_gap=3, preemption_rest=0.3))


def test_nothing_is_interrupted_by_default(world: World) -> None:
    world.client.move(2)
    world.run(3)
    world.client.move(0.2, priority=10)
    world.until_state(2, S.EXECUTING)
    assert world.state(1)[0] is S.COMPLETED


def test_a_task_that_outranks_enough_interrupts_and_the_other_resumes(
    make_world: MakeWorld,
) -> None:
    world = make_world(settings=GAP)
    world.client.move(3, priority=4)
    world.run(4)
    world.client.move(0.2, priority=6)
    world.run(1)
    assert world.state(1)[0] is S.EXECUTING
    world.client.rotate(90, priority=7)
    world.until_state(1, S.PAUSED)
    assert world.state(1) == (S.PAUSED, R.PREEMPTED)
    assert world.paused() is R.NONE
    assert 0 < world.shown(2).time_to_finish < world.shown(1).time_to_finish
    world.until_idle(tasks=3)
    ended = [e.task_id for e in world.events(TaskChanged) if e.new is S.COMPLETED]
    assert ended == [3, 2, 1]
    assert world.states() == [S.COMPLETED] * 3
    assert near_pose(world.pose(), (3.0, 0.0, 0.0))


MARK, KEEP = (PREEMPTIVE, 1), (PREEMPTIBLE, 0)


@for_each(
    "running, waiting, priority, interrupts",
    [
        (None, None, 8, True),
        (None, None, 7, False),
        (KEEP, None, 9, False),
        (KEEP, MARK, 9, False),
        (None, MARK, 1, True),
        (MARK, MARK, 5, False),
        (MARK, MARK, 6, True),
        (MARK, None, 8, True),
    ],
)
def test_who_interrupts_whom(
    make_world: MakeWorld,
    running: tuple[int, int] | None,
    waiting: tuple[int, int] | None,
    priority: int,
    interrupts: bool,
) -> None:
    """By priorities, three apart, and by what each was modified to; not by an inherited rank."""
    world = make_world(settings=GAP)
    world.client.pause()
    world.run(0.1)
    for task, (distance, own, mark) in enumerate(((3.0, 5, running), (0.2, priority, waiting)), 1):
        world.client.move(distance, priority=own)
        world.run(0.05)
        if task == 2:
            world.client.command(MODIFY, task, START_DELAY, 4.0)
        if mark is not None:
            world.client.command(MODIFY, task, *mark)
        world.run(0.1)
    submit(world, after=2, priority=10)
    world.client.proceed()
    world.run(3)
    assert world.state(1)[0] is S.EXECUTING
    world.run(2)
    assert world.state(1) == ((S.PAUSED, R.PREEMPTED) if interrupts else (S.EXECUTING, R.NONE))


@for_each("goal", ["move", "back", "rotate", "turns"])
@for_each("seed", range(tries(2, long=20)))
def test_whatever_interrupts_it_ends_where_it_would_have_ended(
    make_world: MakeWorld, goal: str, seed: int
) -> None:
    random = Random(f"{goal} {seed}")
    world = make_world(seed=seed, settings=GAP)
    command, amount, end = {
        "move": (MOVE, 3.0, (3.0, 0.0, 0.0)),
        "back": (MOVE, -2.0, (-2.0, 0.0, 0.0)),
        "rotate": (ROTATE, 150.0, (0.0, 0.0, 150.0)),
        "turns": (ROTATE, -500.0, (0.0, 0.0, -140.0)),
    }[goal]
    world.client.command(command, amount, 0, 0, 0, 0, 0, 2)
    world.until_state(1, S.EXECUTING)
    others = 1
    for _ in range(random.randrange(1, 5)):
        world.run(random.uniform(0.3, 2.5))
        if world.state(1)[0] is S.COMPLETED:
            break
        kind = random.choice(("move", "rotate", "pause", "takeover"))
        if kind == "move":
            world.client.move(random.uniform(-2.5, 2.5), priority=8)
            others += 1
        elif kind == "rotate":
            world.client.rotate(random.uniform(-400, 400), priority=9)
            others += 1
        else:
            world.client.pause() if kind == "pause" else world.operator_mode(Mode.HOLD)
            world.run(random.uniform(1.0, 3.0))
            if kind == "takeover":  # a continue of just before it would be taken for an older one
                world.run(3.6)
            world.client.proceed()
    world.until_idle(tasks=others, within=240)
    assert world.states() == [S.COMPLETED] * others
    assert near_pose(world.pose(), end), world.pose()
    assert hypot(world.truth.forward_speed, world.truth.yaw_rate) < 0.05
