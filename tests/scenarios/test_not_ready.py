"""A rover that will not arm yet: tasks wait for it, say why, and can be halted meanwhile."""

from mav_tasks.config.settings import Settings, Watch
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from rover_sim.personas import Persona
from tests.kit import px4
from tests.kit.cases import anew, for_each
from tests.kit.rows import check
from tests.kit.volume import some
from tests.kit.world import PROMPT, World
from tests.scenarios.conftest import MakeWorld

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
    check(
        waiting,
        """
wait 30 : - task 1: STARTING / task 2: QUEUED / task 3: QUEUED / queue NONE
fault & idle 3 : - task 1: COMPLETED / task 2: COMPLETED / task 3: COMPLETED / at=0.9,0,0
""",
    )


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
    check(
        world,
        """
fault refuse_arm=1 & TASK_MOVE 0.3 & wait 20 : ACCEPTED task 1: STARTING
until 1 FAILED within=8 : - task 1: FAILED ARM_REFUSED / queue NONE
""",
    )


HALTS = """operator manual : - it is DISARMED / task 1: PAUSED TAKEOVER
ARM 0 : ACCEPTED it is DISARMED / task 1: PAUSED OPERATOR
PAUSE : ACCEPTED it is DISARMED / task 1: PAUSED OPERATOR
TASK_STOP : ACCEPTED it is DISARMED / task 1: KILLED STOP
TASK_CANCEL 1 : ACCEPTED it is DISARMED / task 1: CANCELL"""


@for_each("persona", MAKES)
@for_each("phase", some([0.0, 1.0, 2.0, 4.5], 1, 3))
@for_each("halt", HALTS.splitlines())
def test_what_halts_a_task_halts_one_that_waits(waiting: World, halt: str, phase: float) -> None:
    world = waiting
    check(world, f"TASK_CLEAR & wait {0.1 + phase} : ACCEPTED")  # what waits behind it is no matter
    at = world.now
    check(world, halt)
    becomes = halt.rpartition("/ ")[2]
    check(
        world, f"wait 2.6 : - {becomes}\nfault & wait 10 : - {becomes} / it is DISARMED / at=0,0,0"
    )
    assert arm_requests(world, since=at + 0.1) == 0
