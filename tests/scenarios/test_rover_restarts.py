"""A rover restarts under a task: a person decides, in any order, and the task goes on."""

import pytest

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from rover_sim.personas import PX4, Mode, Persona
from tests.kit import px4
from tests.kit.cases import anew, for_each
from tests.kit.client import ACCEPTED, Sent
from tests.kit.rows import ask, check
from tests.kit.world import PROMPT, World, near_pose
from tests.scenarios.conftest import MakeWorld

RELEASE, AGAIN, REMAINDER = 54013, 0, 1
POSITION = 32
MAKES = [PROMPT, px4.PROMPT_PX4]
UP = 6.0  # s, until a rover that restarts has shown everything
PARKED = "reboot & wait 6 & operator hold & wait 1 & operator manual & wait 1"


@anew
def driving(make_world: MakeWorld, persona: Persona) -> World:
    """A world in which a task drives and another waits."""
    world = make_world(persona=persona)
    world.client.move(4)
    world.client.move(0.5, nonce=2)
    world.until_faster(0.4)
    return world


def restart(world: World, *, up: float = UP) -> None:
    world.rover.autopilot.reboot(now=world.now)
    world.run(up)


def release(world: World, how: int) -> Sent:
    sent = world.client.command(RELEASE, 0, how)
    world.run(0.1)
    return sent


def proceed(world: World) -> Sent:
    sent = world.client.proceed()
    world.run(0.1)
    return sent


@for_each("persona", MAKES)
def test_it_is_told_what_to_do_and_positions_come_as_before(driving: World) -> None:
    world, at = driving, driving.now  # nobody took it over
    held = 'Press "Held: remainder", "Held: again" or "Held: skip", then Continue'
    check(
        world,
        f"""
reboot & wait 6 : - task 1: HELD FRAME_RESET / queue RESTARTED / !taken over / \
Queue paused: after a restart. Press Continue / Rover 1 restarted: task 1 is held. {held}
""",
    )
    assert sum(1.5 < p.at - at < 2.5 for p in world.client.of_id(POSITION)) >= 10


@for_each("persona", MAKES)
@for_each("how", [AGAIN, REMAINDER])
def test_release_and_continue(driving: World, how: int) -> None:
    world = driving
    restart(world)
    where = world.truth.north
    left = 4.0 if how == AGAIN else 4.0 - where
    check(world, f"TASK_RELEASE 0 {how} & until 1 COMPLETED : ACCEPTED #1")
    assert world.truth.north == pytest.approx(where + left, abs=0.15)
    check(
        world,
        """
wait 3 : - task 2: QUEUED NONE
CONTINUE & idle 2 : ACCEPTED task 2: COMPLETED
""",
    )


@for_each("persona", MAKES)
@for_each("word", ["wait 0.4 : -", "CONTINUE : ACCEPTED"])
def test_a_release_while_it_boots_waits_and_says_why(driving: World, word: str) -> None:
    check(
        driving,
        f"""
fault withheld=32,32 & reboot & until 1 HELD within=7 : -
TASK_RELEASE 0 1 : ACCEPTED #1 / Task 1 waits: no valid position
{word}
wait 10 : - task 1: HELD
SHOW 1 : ACCEPTED status 1: HELD NO_POSITION
fault & until 1 COMPLETED : -
""",
    )


HALTS = "DO_PAUSE_CONTINUE 0, TASK_STOP, TASK_CANCEL 1, operator auto, a restart"


@for_each("persona", MAKES)
@for_each("halt", HALTS.split(", "))
def test_a_halt_ends_a_release_that_waits(driving: World, halt: str) -> None:
    world = driving
    world.fault(Faults(withheld=frozenset({POSITION})))
    restart(world, up=4)
    world.until_state(1, S.HELD, within=3)
    release(world, AGAIN)
    where, at = world.pose(), world.now
    if halt == "a restart":
        restart(world, up=0.0)
    else:
        ask(world, halt)
    world.run(4)
    world.fault(Faults())
    world.run(10)
    assert near_pose(world.pose(), where)
    assert "arm" not in world.observer.sent_since(at)
    assert world.state(1)[0] in (S.HELD, S.KILLED, S.CANCELLED)


@for_each("persona", MAKES)
@for_each("person", ["operator disarms & wait 2 & reboot & wait 6", PARKED])
def test_what_a_person_disarmed_is_armed_by_no_release(driving: World, person: str) -> None:
    world = driving
    check(world, f"{person} : - task 1: HELD FRAME_RESET")
    at = world.now
    check(world, "TASK_RELEASE 0 1 & wait 3 : ACCEPTED #1 / task 1: HELD")
    assert "arm" not in world.observer.sent_since(at)
    check(world, "CONTINUE & idle 2 : ACCEPTED task 1: COMPLETED / task 2: COMPLETED")


def test_a_heartbeat_after_the_clock_has_told_of_the_restart_is_no_takeover(
    make_world: MakeWorld,
) -> None:
    """A PX4's mode is in its next heartbeat, up to a second after its positions began anew."""
    check(
        make_world(persona=PX4),
        """
TASK_MOVE 4 & faster 0.4 : ACCEPTED
fault withheld=0,0 & reboot & wait 2 : - !taken over
fault & wait 6 : - task 1: HELD FRAME_RESET / queue RESTARTED / !taken over
TASK_RELEASE 0 1 : ACCEPTED #1
CONTINUE & until 1 COMPLETED within=60 : ACCEPTED
""",
    )


EVERYTHING, ALL_BUT_HEARTBEATS = frozenset(range(300)), frozenset(range(1, 300))


@anew
def idle(make_world: MakeWorld, persona: Persona) -> World:
    """A world in which the rover has driven a task, and stands disarmed in HOLD."""
    world = make_world(persona=persona)
    world.client.move(0.5)
    world.until_idle(tasks=1)
    world.run(15)
    assert (world.is_armed, world.mode()) == (False, Mode.HOLD)
    return world


@for_each("persona", MAKES)
def test_after_a_restart_while_a_task_is_being_cancelled_the_next_one_waits(driving: World) -> None:
    world, at = driving, driving.now
    check(world, "TASK_CANCEL 1 & reboot & wait 20 : ACCEPTED task 1: CANCELLED CANCELLED")
    # a PX4 shows HOLD before its clock tells of the restart, and nothing is left to set that right
    assert world.paused() in (R.RESTARTED, R.TAKEOVER)
    assert "arm" not in world.observer.sent_since(at)


@for_each("persona", MAKES)
@for_each("unheard", [0.0, 2.2, 6.0])
@for_each("unstamped", [0.0, 1.2, 4.5])
def test_a_rover_that_restarts_between_two_tasks_is_driven(
    idle: World, unheard: float, unstamped: float
) -> None:
    """Its first heartbeat may show another mode before its clock shows the restart."""
    world = idle
    world.rover.autopilot.reboot(now=world.now)
    for withheld, seconds in ((EVERYTHING, unheard), (ALL_BUT_HEARTBEATS, unstamped)):
        world.fault(Faults(withheld=withheld))
        world.run(seconds)
    world.fault(Faults())
    world.run(10)
    world.client.move(0.5, nonce=2)
    world.until_state(2, S.COMPLETED, within=40)


@for_each("persona", MAKES)
@for_each("restarts", ["before it", "after it", "long after it", "never"])
def test_a_mode_that_a_person_sets_on_a_disarmed_rover_is_no_restart(
    idle: World, restarts: str
) -> None:
    world, at = idle, idle.now
    if restarts == "before it":
        restart(world)
    is_manual = world.mode() is Mode.MANUAL
    world.operator_mode(Mode.HOLD if is_manual else Mode.MANUAL)
    world.run(5.0 if restarts == "long after it" else 1.2)
    if restarts in ("after it", "long after it"):
        restart(world)
    world.client.move(0.5, nonce=2)
    world.run(12)
    assert world.state(2) == (S.QUEUED, R.NONE)
    assert "arm" not in world.observer.sent_since(at)
    assert any(text.startswith("Task 2 waits: disarmed") for text in world.client.texts())
    assert proceed(world).result == ACCEPTED
    world.until_state(2, S.COMPLETED, within=30)
