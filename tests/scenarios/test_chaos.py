"""Anybody does anything, on any net: no rule is broken, nothing raises, and STOP stops."""

from random import Random

import pytest

from mav_tasks.links.memory import Conditions
from mav_tasks.tasks.driving.legs import leg_of, length_of
from mav_tasks.tasks.driving.mission_sequencer import goal_of
from mav_tasks.tasks.lifecycle import TERMINAL, TaskReason, TaskState
from rover_sim.faults import Faults
from rover_sim.personas import PX4, Mode
from tests.kit import px4
from tests.kit.soak.deeds import Stage, deeds, px4_deeds
from tests.kit.store import LateStore
from tests.kit.volume import tries
from tests.kit.world import PROMPT
from tests.scenarios.conftest import MakeWorld

MAKES = {
    "ardupilot": (PROMPT, deeds),
    "px4": (px4.PROMPT_PX4, px4_deeds),
    "px4 at 1 Hz": (PX4, px4_deeds),
    "generic": (px4.PROMPT_GENERIC, px4_deeds),
}
LIVES = [(make, seed) for make in MAKES for seed in range(tries(3, long=20))]


@pytest.mark.parametrize(("make", "seed"), LIVES)
def test_whatever_happens(make_world: MakeWorld, make: str, seed: int) -> None:
    random = Random(seed)
    persona, what_can_happen = MAKES[make]
    net = Conditions(
        delay=0.002,
        jitter=random.choice((0.0, 0.02)),
        loss=random.choice((0.0, 0.05, 0.2)),
        duplication=random.choice((0.0, 0.1)),
    )
    store = LateStore()
    world = make_world(seed=seed, conditions=net, store=store, persona=persona)
    world.rover.autopilot.parameters[persona.speed_parameter] = 0.8
    world.observer.expects_gaps = True
    others = [world.add_client("second"), world.add_client("third", system_id=9)]
    can_happen = what_can_happen(Stage(world, random, store, (world.client, *others)))
    for _ in range(60):
        random.choice(can_happen)()
        world.run(random.choice((0.01, 0.1, 0.5, 2.0)))

    world.fault(Faults())
    store.delay = 0.0
    world.run(4)
    for _ in range(5):  # enough of it arrives
        world.client.stop(clear=True)
        world.run(0.2)
    world.until(lambda: world.stands() and world.control() == "IDLE", within=8)
    world.run(3)
    where = world.pose()
    world.run(3)
    assert world.pose() == where
    is_disarmed = make == "generic" and not world.rover.autopilot.armed
    assert world.rover.autopilot.mode is Mode.HOLD or is_disarmed
    assert world.paused() is TaskReason.STOPPED
    assert all(task.state in TERMINAL for task in world.tasks())
    for task in world.tasks():
        assert world.history(task.id)[-1][0] is task.state
        if task.state is TaskState.COMPLETED:
            leg = leg_of(goal_of(task), task.progress)
            assert length_of(leg) - task.progress.done <= 0.02
