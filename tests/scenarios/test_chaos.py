"""Anybody does anything, on any net: no rule is broken, nothing raises, and STOP stops."""

from collections.abc import Callable
from random import Random

import pytest

from mav_tasks.links.memory import Conditions
from mav_tasks.tasks.itinerary import goal_of
from mav_tasks.tasks.legs import leg_of, length_of
from mav_tasks.tasks.lifecycle import TERMINAL, TaskReason, TaskState
from rover_sim.faults import Faults
from rover_sim.personas import Mode
from tests.kit.client import AUTO, GUIDED, HOLD, MANUAL, RTL, FakeClient, setpoint, sticks
from tests.kit.store import LateStore
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

MODES = (MANUAL, HOLD, AUTO, RTL, GUIDED)
FAULTS = (
    Faults(silent=True),
    Faults(deaf=True),
    Faults(silent=True, deaf=True),
    Faults(position_frozen=True),
    Faults(position_jump=(3.0, 0.0)),
    Faults(refuse_arm=True),
    Faults(refuse_mode=True),
    Faults(withheld=frozenset({0})),
    Faults(withheld=frozenset({32})),
)


def deeds(world: World, random: Random, store: LateStore) -> list[Callable[[], object]]:
    """Give what can happen; the more often a deed is named, the more often it does."""
    clients = (world.client, world.add_client("second"), world.add_client("third", system_id=9))

    def client() -> FakeClient:
        return random.choice(clients)

    def submit() -> None:
        for _ in range(3):
            client().move(random.choice((-1.0, 0.5, 2.0)), nonce=random.randrange(1, 1 << 24))

    return [
        submit,
        submit,
        lambda: client().rotate(random.uniform(-90, 90)),
        lambda: client().proceed(),
        lambda: client().proceed(),
        lambda: client().proceed(),
        lambda: client().pause(),
        lambda: client().stop(clear=random.random() < 0.5),
        lambda: client().mode(random.choice(MODES)),
        lambda: client().mode(HOLD),
        lambda: client().arm(random.random() < 0.5),
        lambda: client().send(sticks(random.choice((0, 300)))),
        lambda: client().send(setpoint(0.3)),
        lambda: world.operator_mode(random.choice((Mode.HOLD, Mode.HOLD, *Mode))),
        lambda: world.operator_arm(random.random() < 0.7),
        lambda: world.fault(random.choice(FAULTS)),
        lambda: world.fault(Faults()),
        lambda: world.fault(Faults()),
        lambda: world.rover.autopilot.reboot(now=world.now),
        lambda: world.suspend_server(random.choice((0.05, 0.4, 0.8))),
        lambda: setattr(store, "delay", random.choice((0.0, 0.0, 0.1, 2.0))),
    ]


@pytest.mark.parametrize("seed", range(8))
def test_whatever_happens(make_world: MakeWorld, seed: int) -> None:
    random = Random(seed)
    net = Conditions(
        delay=0.002,
        jitter=random.choice((0.0, 0.02)),
        loss=random.choice((0.0, 0.05, 0.2)),
        duplication=random.choice((0.0, 0.1)),
    )
    store = LateStore()
    world = make_world(seed=seed, conditions=net, store=store)
    world.rover.autopilot.parameters["WP_SPEED"] = 0.8
    world.observer.expects_gaps = True
    can_happen = deeds(world, random, store)
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
    assert world.rover.autopilot.mode is Mode.HOLD
    assert world.paused() is TaskReason.STOPPED
    assert all(task.state in TERMINAL for task in world.tasks())
    for task in world.tasks():
        assert world.history(task.id)[-1][0] is task.state
        if task.state is TaskState.COMPLETED:
            leg = leg_of(goal_of(task), task.progress)
            assert length_of(leg) - task.progress.done <= 0.02
