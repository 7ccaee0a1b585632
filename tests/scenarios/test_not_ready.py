"""A rover that will not arm yet: tasks wait for it, say why, and can be halted meanwhile."""

from collections.abc import Callable

from mav_tasks.config.settings import Settings, Watch
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from rover_sim.personas import Mode, Persona
from tests.kit import px4
from tests.kit.cases import anew, for_each
from tests.kit.volume import some
from tests.kit.world import PROMPT, World, near_pose
from tests.scenarios.conftest import MakeWorld

CANCEL = 54010
NOT_READY = Faults(refuse_arm=True)
MAKES = [PROMPT, px4.PROMPT_PX4]


@anew
def waiting(make_world: MakeWorld, persona: Persona) -> World:
    """A world in which a task waits for a rover that will not arm, and two wait behind it."""
    world = make_world(persona=persona)
    world.fault(NOT_READY)
    for number in (1, 2, 3):
        world.client.move(0.3, nonce=number)
    world.run(5)
    return world


def arm_requests(world: World, *, since: float) -> int:
    return world.observer.sent_since(since).count("arm")


@for_each("persona", MAKES)
def test_tasks_wait_until_it_is_ready_and_are_driven_then(waiting: World) -> None:
    world = waiting
    world.run(30)
    assert [world.state(number)[0] for number in (1, 2, 3)] == [S.STARTING, S.QUEUED, S.QUEUED]
    assert world.paused() is R.NONE
    world.fault(Faults())
    world.until_idle(tasks=3)
    assert world.states() == [S.COMPLETED] * 3
    assert near_pose(world.pose(), (0.9, 0.0, 0.0))


@for_each("persona", MAKES)
def test_it_says_so_in_the_rovers_own_words(waiting: World) -> None:
    world = waiting
    words = "Arm: refused by a simulated fault"
    assert f"Task 1 waits: the rover is not ready to arm: {words}" in world.client.texts()
    status = world.shown(1)
    assert status.why == (S.STARTING, R.NOT_READY)
    assert status.text == f"move 0.3 m: starting (not ready: {words})"[:50]
    said = world.client.texts().count(f"Task 1 waits: the rover is not ready to arm: {words}")
    world.run(20)
    assert said == 1, "once, as long as nothing changes"


@for_each("persona", MAKES)
def test_after_a_time_it_fails_as_refused(make_world: MakeWorld, persona: Persona) -> None:
    world = make_world(persona=persona, settings=Settings(watch=Watch(ready_timeout=20.0)))
    world.fault(NOT_READY)
    at = world.now
    world.client.move(0.3)
    world.until_state(1, S.FAILED, within=40)
    assert world.state(1) == (S.FAILED, R.ARM_REFUSED)
    assert 20 < world.now - at < 28
    assert world.paused() is R.NONE, "nothing has moved"


HALTS: dict[str, tuple[Callable[[World], object], tuple[S, R]]] = {
    "another mode": (lambda w: w.operator_mode(Mode.MANUAL), (S.PAUSED, R.TAKEOVER)),
    "disarm": (lambda w: w.client.arm(False), (S.PAUSED, R.OPERATOR)),
    "pause": (lambda w: w.client.pause(), (S.PAUSED, R.OPERATOR)),
    "STOP": (lambda w: w.client.stop(), (S.KILLED, R.STOP)),
    "cancel": (lambda w: w.client.command(CANCEL, 1), (S.CANCELLED, R.CANCELLED)),
}


@for_each("persona", MAKES)
@for_each("phase", some([0.0, 1.0, 2.0, 4.5], 1, 3))
@for_each("halt", HALTS)
def test_what_halts_a_task_halts_one_that_waits(waiting: World, halt: str, phase: float) -> None:
    world = waiting
    do, becomes = HALTS[halt]
    world.client.command(54011, 0)  # what waits behind it is no matter here
    world.run(0.1 + phase)
    at = world.now
    do(world)
    world.run(3)
    assert world.state(1) == becomes
    world.fault(Faults())
    world.run(10)
    assert world.state(1) == becomes
    assert arm_requests(world, since=at + 0.1) == 0
    assert not world.is_armed
    assert near_pose(world.pose(), (0.0, 0.0, 0.0))
