"""A rover's clock that goes back: a restart, however long it was up, or an old packet once more.

Attack D9: a restart after 24.86 days of uptime was taken for a clock that goes forward, and
*continue* drove the remainder in a lost frame. And a position that was delivered again 1.1 s late
was taken for a restart.
"""

import pytest

from mav_tasks.shell.in_memory import VEHICLE_LINK
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Persona
from tests.kit.cases import for_each
from tests.kit.px4 import PROMPT_PX4
from tests.kit.world import MEASURED, OFF, PROMPT, World
from tests.scenarios.conftest import MakeWorld

DAY = 86_400.0  # s
OVERFLOW = 2**32 / 1000  # s
MAKES = [PROMPT, PROMPT_PX4]


def drives(world: World, *, distance: float = 4.0) -> None:
    """Begin a move, and let the rover come to its speed."""
    world.client.move(distance)
    world.until_faster(0.4, within=15)


@for_each("days", [1, 24, 25, 30, 49])
@for_each("persona", MAKES)
def test_a_restart_holds_the_task_however_long_the_rover_was_up(
    make_world: MakeWorld, persona: Persona, days: float
) -> None:
    world = make_world(persona=persona)
    world.rover.autopilot.reboot(now=-days * DAY)
    world.run(5)
    drives(world)
    world.rover.autopilot.reboot(now=world.now)
    world.run(3)
    where = world.truth.north
    assert world.state(1) == (S.HELD, R.FRAME_RESET)
    assert world.paused() is R.RESTARTED
    world.client.proceed()
    world.run(5)
    assert world.truth.north == pytest.approx(where, abs=0.01)


@for_each("persona", MAKES)
def test_a_clock_that_overflows_while_it_drives_interrupts_nothing(
    make_world: MakeWorld, persona: Persona
) -> None:
    world = make_world(persona=persona)
    world.rover.autopilot.reboot(now=world.now - OVERFLOW + 8.0)
    world.run(4)
    drives(world)
    world.until_state(1, S.COMPLETED, within=30)
    assert {S.HELD, S.PAUSED}.isdisjoint(state for state, _ in world.history(1))
    assert world.truth.north == pytest.approx(4.0, abs=OFF)


@for_each("times", [1, 5])
@for_each("late", [1.1, 4.0, 20.0])
def test_what_is_delivered_again_late_interrupts_nothing(
    make_world: MakeWorld, late: float, times: int
) -> None:
    world = make_world()
    world.run(30)
    said = world.overheard(lambda source, _target, data: source == "rover1" and data[7] in MEASURED)
    world.client.move(12)
    world.run(1.0)
    copies = said[: 2 * times]
    world.run(late)
    zeros = sum(speed == 0.0 for _, speed in setpoints(world))
    for data in copies:
        world.net.send("rover1", VEHICLE_LINK, data)
        world.run(0.02)
    world.run(1.0)
    assert sum(speed == 0.0 for _, speed in setpoints(world)) == zeros, "it drives on"
    world.until_state(1, S.COMPLETED, within=60)
    assert S.HELD not in [state for state, _ in world.history(1)]
    assert not world.client.said("restarted")


def setpoints(world: World) -> list[tuple[float, float]]:
    """Return when set-points left, and the speed that they asked for."""
    return [(at, m.vx) for at, m in world.observer.driven if hasattr(m, "vx")]
