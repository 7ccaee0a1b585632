"""A more urgent task interrupts another, which then ends exactly where it would have ended."""

from math import hypot, nan
from pathlib import Path
from random import Random

from mav_tasks.config.settings import Queueing, Settings
from mav_tasks.tasks.events import TaskChanged
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.body import Pose
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.client import MOVE, ROTATE
from tests.kit.restarts import UTC, restart
from tests.kit.rows import check
from tests.kit.store import PromptSqliteStore
from tests.kit.volume import tries
from tests.kit.words import CANCEL, REPOSITION
from tests.kit.world import World, at, near_pose
from tests.scenarios.conftest import MakeWorld

GAP = Settings(queueing=Queueing(preemption_gap=3, preemption_rest=0.3))


def test_nothing_is_interrupted_by_default(world: World) -> None:
    check(
        world,
        """
TASK_MOVE 2 & wait 3 : ACCEPTED
TASK_MOVE 0.2 0 0 0 0 0 10 & until 2 EXECUTING : ACCEPTED task 1: COMPLETED
""",
    )


def test_a_task_that_outranks_enough_interrupts_and_the_other_resumes(
    make_world: MakeWorld,
) -> None:
    world = make_world(settings=GAP)
    check(
        world,
        """
TASK_MOVE 3 0 0 0 0 0 4 & wait 4 : ACCEPTED
TASK_MOVE 0.2 0 0 0 0 0 6 & wait 1 : ACCEPTED task 1: EXECUTING
TASK_ROTATE 90 0 0 0 0 0 7 & until 1 PAUSED : ACCEPTED task 1: PAUSED PREEMPTED / queue NONE
""",
    )
    assert 0 < world.shown(2).time_to_finish < world.shown(1).time_to_finish
    check(world, "idle 3 : - at=3,0,0")
    ended = [e.task_id for e in world.events(TaskChanged) if e.new is S.COMPLETED]
    assert ended == [3, 2, 1]


KEEP, MARK = "TASK_MODIFY {} 5 0 : ACCEPTED", "TASK_MODIFY {} 6 1 : ACCEPTED"


@for_each(
    "running, waiting, priority, becomes",
    [
        ("", "", 8, "PAUSED PREEMPTED"),
        ("", "", 7, "EXECUTING NONE"),
        (KEEP, "", 9, "EXECUTING NONE"),
        (KEEP, MARK, 9, "EXECUTING NONE"),
        ("", MARK, 1, "PAUSED PREEMPTED"),
        (MARK, MARK, 5, "EXECUTING NONE"),
        (MARK, MARK, 6, "PAUSED PREEMPTED"),
        (MARK, "", 8, "PAUSED PREEMPTED"),
    ],
)
def test_who_interrupts_whom(
    make_world: MakeWorld, running: str, waiting: str, priority: int, becomes: str
) -> None:
    """By priorities, three apart, and by what each was modified to; not by an inherited rank."""
    world = make_world(settings=GAP)
    rows = f"""
PAUSE : ACCEPTED
TASK_MOVE 3 0 0 0 0 0 5 : ACCEPTED #1
{running.format(1)}
TASK_MOVE 0.2 0 0 0 0 0 {priority} : ACCEPTED #2
TASK_MODIFY 2 2 4 : ACCEPTED
{waiting.format(2)}
TASK_MOVE 0.2 0 0 0 2 0 10 : ACCEPTED #3
CONTINUE & wait 2.4 : ACCEPTED task 1: EXECUTING
wait 2.4 : - task 1: {becomes}
"""
    check(world, rows.replace("\n\n", "\n"))


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


def carry(world: World) -> None:
    for _ in range(80):
        seen = world.truth
        world.rover.place(Pose(north=seen.north, east=seen.east + 0.1, yaw=seen.yaw))
        world.run(0.1)


@for_each("where", ["paused", "disarmed", "restarted", "ended well", "before a click"])
def test_it_does_not_drive_back_from_where_no_task_has_driven(
    make_world: MakeWorld, tmp_path: Path, where: str
) -> None:
    path = tmp_path / "tasks.sqlite3"
    world = make_world(settings=GAP, store=PromptSqliteStore(path, wall_offset=UTC))
    world.client.move(4)
    world.run(4)
    if where != "before a click":
        world.client.rotate(90, priority=9)
        world.until_state(2, S.EXECUTING)
    world.client.pause()
    world.run(2)
    if where == "disarmed":
        world.client.arm(False)
        world.run(2)
    carry(world)
    if where not in ("paused", "disarmed"):
        restart(world, path, well=where == "ended well")
    if where == "before a click":
        world.client.command_int(REPOSITION, -1, 1, 0, nan, target=(1, 1), frame=6, **at(1, 8))
    else:
        world.client.command(CANCEL, 2)
    world.run(4)
    there = world.pose()
    world.client.proceed()
    world.run(10)
    assert world.state(1) == (S.HELD, R.OFF_TRACK)
    assert near_pose(world.pose(), there)
