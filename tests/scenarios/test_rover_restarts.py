"""A rover restarts under a task: a person decides, in any order, and the task goes on."""

from dataclasses import replace

import pytest

from mav_tasks.settings import Roles, Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from rover_sim.personas import PX4, Mode, Persona
from rover_sim.realism import ARDUPILOT_BOOT, EXACT
from tests.kit import px4
from tests.kit.client import ACCEPTED, DENIED, Sent
from tests.kit.world import PROMPT, World, near_pose
from tests.scenarios.conftest import MakeWorld

RELEASE, AGAIN, REMAINDER, SKIP = 54013, 0, 1, 2
POSITION = 32
MAKES = {"ardupilot": PROMPT, "px4": px4.PROMPT_PX4}
UP = 6.0  # s, until a rover that restarts has shown everything


@pytest.fixture(params=MAKES)
def persona(request: pytest.FixtureRequest) -> Persona:
    return MAKES[request.param]


@pytest.fixture
def driving(make_world: MakeWorld, persona: Persona) -> World:
    """A world in which a task drives and another waits."""
    world = make_world(persona=persona)
    world.client.move(4)
    world.client.move(0.5, nonce=2)
    world.until(lambda: world.truth.forward_speed > 0.4, within=10)
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


def test_it_is_told_what_to_do(driving: World) -> None:
    world = driving
    restart(world)
    assert world.state(1) == (S.HELD, R.FRAME_RESET)
    assert world.paused() is R.RESTARTED, "nobody took it over"
    texts = world.client.texts()
    assert "Queue paused: after a restart. Press Continue" in texts
    assert (
        "Rover 1 restarted: task 1 is held. Press"
        ' "Held: remainder", "Held: again" or "Held: skip", then Continue'
    ) in texts


@pytest.mark.parametrize("how", [AGAIN, REMAINDER])
def test_release_and_continue(driving: World, how: int) -> None:
    world = driving
    restart(world)
    where = world.truth.north
    left = 4.0 if how == AGAIN else 4.0 - where
    assert release(world, how).answer == (ACCEPTED, 1)
    world.until_state(1, S.COMPLETED)
    assert world.truth.north == pytest.approx(where + left, abs=0.15)
    world.run(3)
    assert world.state(2) == (S.QUEUED, R.NONE), "the queue waits for the word"
    assert proceed(world).result == ACCEPTED
    world.until_idle(tasks=2)
    assert world.state(2)[0] is S.COMPLETED


@pytest.mark.parametrize("how", [AGAIN, REMAINDER])
def test_continue_and_release(driving: World, how: int) -> None:
    world = driving
    restart(world)
    where = world.pose()
    assert proceed(world).result == ACCEPTED
    assert any("keeps task 1 on hold: press" in text for text in world.client.texts())
    world.run(5)
    assert world.state(1) == (S.HELD, R.FRAME_RESET)
    assert near_pose(world.pose(), where), "what is held moves nothing"
    assert release(world, how).answer == (ACCEPTED, 1)
    world.until_idle(tasks=2)
    assert [task.state for task in world.tasks()] == [S.COMPLETED] * 2


def test_release_and_continue_at_once(driving: World) -> None:
    world = driving
    restart(world)
    assert release(world, REMAINDER).result == ACCEPTED
    assert proceed(world).result == ACCEPTED
    world.until_idle(tasks=2)
    assert [task.state for task in world.tasks()] == [S.COMPLETED] * 2


def test_skip_and_continue(driving: World) -> None:
    world = driving
    restart(world)
    assert release(world, SKIP).result == ACCEPTED
    world.run(3)
    assert not world.rover.autopilot.armed
    assert proceed(world).result == ACCEPTED
    world.until_idle(tasks=2)
    assert [task.state for task in world.tasks()] == [S.CANCELLED, S.COMPLETED]


def test_a_release_at_the_moment_that_it_is_held_waits_for_the_rover(driving: World) -> None:
    world = driving
    world.rover.autopilot.reboot(now=world.now)
    world.until_state(1, S.HELD, within=3)
    assert release(world, REMAINDER).answer == (ACCEPTED, 1)
    world.until_state(1, S.COMPLETED)


@pytest.mark.parametrize("order", ["release first", "continue between"])
def test_a_release_while_it_boots_waits_and_says_why(driving: World, order: str) -> None:
    world = driving
    world.fault(Faults(withheld=frozenset({POSITION})))
    restart(world, up=4)
    world.until_state(1, S.HELD, within=3)
    assert release(world, REMAINDER).answer == (ACCEPTED, 1)
    if order == "continue between":
        assert proceed(world).result == ACCEPTED
    world.run(10)
    assert world.state(1)[0] is S.HELD
    assert "Task 1 waits: no valid position" in world.client.texts()
    world.client.request_status(1)
    world.run(0.1)
    assert world.client.statuses(1)[-1].why == (S.HELD, R.NO_POSITION)
    world.fault(Faults())
    world.until_state(1, S.COMPLETED)


def test_a_release_that_waits_too_long_is_to_be_given_again(
    make_world: MakeWorld, persona: Persona
) -> None:
    settings = Settings()
    settings = replace(settings, watch=replace(settings.watch, ready_timeout=5.0))
    world = make_world(persona=persona, settings=settings)
    world.client.move(4)
    world.until(lambda: world.truth.forward_speed > 0.4, within=10)
    world.fault(Faults(withheld=frozenset({POSITION})))
    restart(world, up=4)
    world.until_state(1, S.HELD, within=3)
    release(world, REMAINDER)
    world.run(6)
    assert any("holds task 1 again" in text for text in world.client.texts())
    where = world.pose()
    world.fault(Faults())
    world.run(10)
    assert (world.state(1), world.pose()) == ((S.HELD, R.FRAME_RESET), where)
    assert release(world, REMAINDER).result == ACCEPTED
    world.until_state(1, S.COMPLETED)


HALTS = {
    "pause": lambda w: w.client.pause(),
    "STOP": lambda w: w.client.stop(),
    "cancel": lambda w: w.client.command(54010, 1),
    "a restart": lambda w: w.rover.autopilot.reboot(now=w.now),
    "another mode": lambda w: w.operator_mode(Mode.AUTO),
}


@pytest.mark.parametrize("halt", HALTS)
def test_a_halt_ends_a_release_that_waits(driving: World, halt: str) -> None:
    world = driving
    world.fault(Faults(withheld=frozenset({POSITION})))
    restart(world, up=4)
    world.until_state(1, S.HELD, within=3)
    release(world, AGAIN)
    where, at = world.pose(), world.now
    HALTS[halt](world)
    world.run(4)
    world.fault(Faults())
    world.run(10)
    assert near_pose(world.pose(), where)
    assert "arm" not in world.observer.sent_since(at)
    assert world.state(1)[0] in (S.HELD, S.KILLED, S.CANCELLED)


@pytest.mark.parametrize("is_first", [True, False])
def test_what_a_person_disarmed_is_armed_by_no_release(driving: World, *, is_first: bool) -> None:
    world = driving
    if is_first:
        world.operator_arm(False)
        world.run(2)
        restart(world)
    else:
        restart(world)
        world.operator_mode(Mode.HOLD)
        world.run(1)
        world.operator_mode(Mode.MANUAL)
        world.run(1)
    at = world.now
    assert world.state(1) == (S.HELD, R.FRAME_RESET)
    assert release(world, REMAINDER).answer == (ACCEPTED, 1)
    world.run(3)
    assert "arm" not in world.observer.sent_since(at)
    assert world.state(1)[0] is S.HELD
    assert proceed(world).result == ACCEPTED
    world.until_idle(tasks=2)
    assert [task.state for task in world.tasks()] == [S.COMPLETED] * 2


def test_who_may_not_continue_arms_nothing_by_a_release(
    make_world: MakeWorld, persona: Persona
) -> None:
    settings = Settings(roles=Roles(unsigned="submitter"))
    world = make_world(persona=persona, settings=settings)
    world.client.move(4)
    world.until(lambda: world.truth.forward_speed > 0.3, within=10)
    restart(world)
    at = world.now
    assert release(world, REMAINDER).answer == (ACCEPTED, 1)
    world.run(3)
    assert "arm" not in world.observer.sent_since(at)
    assert world.state(1)[0] is S.HELD


def test_nothing_to_continue_is_told_with_what_to_do(driving: World) -> None:
    world = driving
    restart(world)
    proceed(world)
    world.run(4)
    assert proceed(world).answer == (DENIED, R.WRONG_STATE)
    assert any("release it (again" in text for text in world.client.texts())


@pytest.mark.parametrize("after", [0.0, 0.3, 0.7, 1.2])
def test_a_task_of_which_nothing_was_driven_begins_when_the_rover_is_back(
    make_world: MakeWorld, persona: Persona, after: float
) -> None:
    """It was submitted before anybody could know that the rover had restarted."""
    world = make_world(persona=persona)
    world.run(2.0)
    world.rover.autopilot.reboot(now=world.now)
    world.run(after)
    world.client.move(1.0)
    world.until_state(1, S.COMPLETED, within=60)
    assert world.paused() is R.NONE
    assert S.HELD not in [state for state, _ in world.history(1)]


def test_a_heartbeat_after_the_clock_has_told_of_the_restart_is_no_takeover(
    make_world: MakeWorld,
) -> None:
    """A PX4's mode is in its next heartbeat, up to a second after its positions began anew."""
    world = make_world(persona=PX4)
    world.client.move(4)
    world.until(lambda: world.truth.forward_speed > 0.4, within=10)
    world.fault(Faults(withheld=frozenset({0})))  # its heartbeat comes last
    restart(world, up=2.0)
    world.fault(Faults())
    world.run(UP)
    assert world.state(1) == (S.HELD, R.FRAME_RESET)
    assert world.paused() is R.RESTARTED
    assert not any("taken over" in text for text in world.client.texts())
    assert release(world, REMAINDER).answer == (ACCEPTED, 1)
    proceed(world)
    world.until_state(1, S.COMPLETED, within=60)


def test_another_origin_holds_no_task_of_which_nothing_was_driven(
    make_world: MakeWorld, persona: Persona
) -> None:
    """A PX4 that boots has an origin of its own a second after it can be spoken to."""
    world = make_world(persona=persona)
    world.rover.autopilot.set_faults(Faults(refuse_arm=True))
    world.client.move(1.0)
    world.run(2.0)
    assert world.state(1)[0] is S.STARTING
    world.fault(Faults(refuse_arm=True, position_jump=(5.0, 3.0)))
    world.run(2.0)
    world.fault(Faults(position_jump=(5.0, 3.0)))
    world.until_state(1, S.COMPLETED, within=60)


def test_it_is_not_armed_any_more_once_its_clock_tells_of_the_restart(driving: World) -> None:
    """The heartbeat that says so comes later, and what was shown before it is not so any more."""
    world = driving
    world.fault(Faults(withheld=frozenset({0})))
    restart(world, up=1.5)
    assert world.state(1) == (S.HELD, R.FRAME_RESET)
    at = world.now
    proceed(world)
    assert release(world, REMAINDER).answer == (ACCEPTED, 1)
    world.run(1.0)
    assert "move" not in world.observer.sent_since(at), "nobody has seen it armed since"
    world.fault(Faults())
    world.until_state(1, S.COMPLETED, within=60)


EVERYTHING, ALL_BUT_HEARTBEATS = frozenset(range(300)), frozenset(range(1, 300))
HEARTBEATS = frozenset({0})
HANDED_BACK = 6.0  # s after a task, in which the server has HOLD shown and disarms


@pytest.fixture
def idle(make_world: MakeWorld, persona: Persona) -> World:
    """A world in which the rover has driven a task, and stands disarmed in HOLD."""
    world = make_world(persona=persona)
    world.client.move(0.5)
    world.until_idle(tasks=1)
    world.run(15)
    assert (world.rover.autopilot.armed, world.rover.autopilot.mode) == (False, Mode.HOLD)
    return world


@pytest.mark.parametrize("unheard", [0.0, 2.2, 6.0])
@pytest.mark.parametrize("unstamped", [0.0, 1.2, 4.5])
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


@pytest.mark.parametrize("moment", ["RELEASING", "armed by a client"])
@pytest.mark.parametrize("withheld", [None, ALL_BUT_HEARTBEATS, HEARTBEATS, EVERYTHING])
def test_a_rover_that_restarts_armed_between_two_tasks_is_driven(
    make_world: MakeWorld, persona: Persona, moment: str, withheld: frozenset[int] | None
) -> None:
    """Nobody has disarmed it, and nothing was held that a person would have to decide about."""
    world = make_world(persona=persona)
    world.client.move(0.5)
    world.until_state(1, S.COMPLETED)
    if moment == "armed by a client":
        world.client.arm()
        world.run(HANDED_BACK)
    else:
        world.until(lambda: world.control() == moment, within=10)
    assert world.rover.autopilot.armed
    world.rover.autopilot.reboot(now=world.now)
    world.fault(Faults(withheld=withheld or frozenset()))
    world.run(2.2)
    world.fault(Faults())
    world.run(0.2)
    world.client.move(0.5, nonce=2)
    world.until_state(2, S.COMPLETED, within=40)
    assert world.paused() is R.NONE


@pytest.mark.parametrize("moment", ["before it", "after it"])
def test_a_rover_that_a_person_disarmed_stays_so_across_its_restart(
    idle: World, moment: str
) -> None:
    world = idle
    world.client.arm()
    world.run(1.2)
    if moment == "before it":
        world.operator_arm(False)
        world.run(1.2)
    world.rover.autopilot.reboot(now=world.now)
    world.run(UP)
    if moment == "after it":
        world.operator_arm(True)
        world.run(1.2)
        world.operator_arm(False)
        world.run(1.2)
    at = world.now
    world.client.move(0.5, nonce=2)
    world.run(8)
    assert "arm" not in world.observer.sent_since(at)
    assert proceed(world).result == ACCEPTED
    world.until_state(2, S.COMPLETED, within=30)


def test_a_rover_that_is_silent_for_longer_than_it_was_up_before_is_driven(idle: World) -> None:
    """As after a change of its battery: its new clock is ahead of the old one."""
    world = idle
    world.run(30)
    world.rover.autopilot.reboot(now=world.now)
    world.fault(Faults(withheld=EVERYTHING))
    world.run(90)
    world.fault(Faults())
    world.run(10)
    assert "Rover 1 restarted" in world.client.texts()
    world.client.move(0.5, nonce=2)
    world.until_state(2, S.COMPLETED, within=40)


def test_a_task_that_is_submitted_while_the_rover_boots_waits_until_it_is_ready(
    make_world: MakeWorld,
) -> None:
    """It says so: nobody has to set a mode, or to resume."""
    world = make_world(realism=replace(EXACT, boot=ARDUPILOT_BOOT.scaled(0.5)))
    world.run(30)
    world.rover.autopilot.reboot(now=world.now)
    world.until(lambda: world.rover.autopilot.mode is Mode.INITIALISING, within=3)
    world.run(1.1)
    assert world.rover.autopilot.mode is Mode.INITIALISING
    world.client.move(0.5)
    world.run(0.1)
    world.client.request_status(1)
    world.run(0.1)
    assert world.client.statuses(1)[-1].why == (S.QUEUED, R.NOT_READY)
    world.until_state(1, S.COMPLETED, within=60)


@pytest.mark.parametrize("restarts", ["before it", "after it", "long after it", "never"])
def test_a_mode_that_a_person_sets_on_a_disarmed_rover_is_no_restart(
    idle: World, restarts: str
) -> None:
    world, at = idle, idle.now
    if restarts == "before it":
        restart(world)
    is_manual = world.rover.autopilot.mode is Mode.MANUAL
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


def test_a_mode_without_a_clock_is_a_persons_after_5_s(idle: World) -> None:
    world = idle
    world.fault(Faults(withheld=ALL_BUT_HEARTBEATS))
    world.operator_mode(Mode.MANUAL)
    world.run(1.2)
    at = world.now
    world.client.move(0.5, nonce=2)
    world.run(8)
    world.fault(Faults())
    world.run(8)
    assert world.state(2) == (S.QUEUED, R.NONE)
    assert "arm" not in world.observer.sent_since(at)
    assert proceed(world).result == ACCEPTED
    world.until_state(2, S.COMPLETED, within=30)


@pytest.mark.parametrize("word", ["move", "resume", "arm"])
def test_a_word_is_newer_than_the_mode_that_was_seen_before_it(idle: World, word: str) -> None:
    """The server decides first what the mode change was: a resume after it counts."""
    world = idle
    world.fault(Faults(withheld=ALL_BUT_HEARTBEATS))
    world.operator_mode(Mode.MANUAL)
    world.run(1.2)
    at = world.now
    if word == "resume":
        proceed(world)
    elif word == "arm":
        world.operator_arm(True)
        world.run(1.2)
    world.client.move(0.5, nonce=2)
    world.fault(Faults())
    world.run(12)
    assert ("arm" in world.observer.sent_since(at)) is (word == "resume")
    assert (world.state(2)[0] is S.COMPLETED) is (word == "resume")
