"""Anybody does anything, on any net: no rule is broken, nothing raises, and STOP stops."""

from collections.abc import Callable
from math import nan
from random import Random
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.links.memory import Conditions
from mav_tasks.tasks.itinerary import goal_of
from mav_tasks.tasks.legs import leg_of, length_of
from mav_tasks.tasks.lifecycle import TERMINAL, TaskReason, TaskState
from rover_sim.faults import Faults
from rover_sim.personas import PX4, Mode
from tests.kit import px4
from tests.kit.client import (
    AUTO,
    GUIDED,
    HOLD,
    MANUAL,
    RTL,
    FakeClient,
    set_mode,
    setpoint,
    sticks,
)
from tests.kit.mission import Item, Upload
from tests.kit.store import LateStore
from tests.kit.world import PROMPT, World, at
from tests.scenarios.conftest import MakeWorld

MODES = (MANUAL, HOLD, AUTO, RTL, GUIDED)
PX4_MODES = (px4.MANUAL, px4.HOLD, px4.MISSION, px4.RETURN, px4.OFFBOARD)
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


def px4_deeds(world: World, random: Random, store: LateStore) -> list[Callable[[], object]]:
    """Give the same and more for a rover that speaks as PX4 does."""
    clients = (world.client, world.add_client("fourth"))
    other = world.net.link("other station")

    def client() -> FakeClient:
        return random.choice(clients)

    def place() -> dict[str, Any]:
        return at(random.uniform(-3, 3), random.uniform(-3, 3))

    def go_to() -> None:
        sender = client()
        if random.random() < 0.5:
            px4.ask_mode(sender, px4.HOLD)
        sender.command_int(px4.REPOSITION, -1, 1, 0, nan, **place(), frame=6, target=(1, 1))

    def go_to_by_another_station() -> None:
        message = common.MAVLink_command_int_message(
            *(1, 1, 6, px4.REPOSITION, 0, 0, -1, 1, 0, nan), *place().values(), 0
        )
        other.send("rover1", message.pack(common.MAVLink(None, 255, 190)))

    def end_streams() -> None:
        for each in clients:
            each.end_streams()

    return [
        *deeds(world, random, store),
        go_to,
        go_to,
        go_to_by_another_station,
        lambda: Upload(client(), [Item(16, **place()), Item(16, **place())]),
        lambda: px4.ask_mode(client(), random.choice(PX4_MODES)),
        lambda: px4.ask_mode(client(), px4.HOLD),
        lambda: px4.ask_mode(client(), px4.MISSION),
        lambda: px4.ask_mode(client(), px4.OFFBOARD),
        lambda: client().send(set_mode(random.choice(PX4_MODES))),
        lambda: client().stream(setpoint(0.3), rate=20),
        end_streams,
    ]


MAKES = {
    "ardupilot": (PROMPT, deeds),
    "px4": (px4.PROMPT_PX4, px4_deeds),
    "px4 at 1 Hz": (PX4, px4_deeds),
    "generic": (px4.PROMPT_GENERIC, px4_deeds),
}
LIVES = [("ardupilot", seed) for seed in range(8)] + [
    (make, seed) for make in MAKES for seed in range(4) if make != "ardupilot"
]


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
    can_happen = what_can_happen(world, random, store)
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
