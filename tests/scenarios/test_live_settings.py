"""Settings that change while the server runs: each has effect, on what is there already, too."""

from mav_tasks.config.settings import (
    Driving,
    Settings,
    Watch,
)
from mav_tasks.engine.inputs import SettingsChanged
from mav_tasks.tasks.events import VehicleNoted
from rover_sim.faults import Faults
from tests.kit.cases import for_each
from tests.kit.rows import check
from tests.kit.world import World
from tests.scenarios.test_parameters import ask, put, told


def change(world: World, settings: Settings) -> None:
    world.server.pump.handle(SettingsChanged(settings), now=world.now)
    world.server.pump.turn(now=world.now)


def test_the_next_task_is_driven_at_the_new_speed(world: World) -> None:
    check(world, "TASK_MOVE 2 & until 1 EXECUTING : ACCEPTED")
    change(world, Settings(driving=Driving(speed=1.2)))
    check(world, "idle 1 : -\nTASK_MOVE 5 & faster 1.1 & idle 2 : ACCEPTED")


def test_a_lower_limit_slows_down_at_once(world: World) -> None:
    check(world, "TASK_MOVE 10 1.5 & faster 1.4 : ACCEPTED")
    change(world, Settings(driving=Driving(max_speed=0.6)))
    check(world, "wait 3 : - task 1: EXECUTING")
    assert world.truth.forward_speed < 0.65


@for_each("limit, is_lost", [(1.5, True), (20.0, False)])
def test_a_rover_is_lost_after_the_new_time(world: World, limit: float, is_lost: bool) -> None:
    """Nothing comes from it any more that would make the server look again."""
    world.fault(Faults(silent=True))
    world.run(1.0)
    change(world, Settings(watch=Watch(heartbeat_lost=limit)))
    world.run(1.5 if is_lost else 6.0)
    silent = [event for event in world.events(VehicleNoted) if "silent" in str(event)]
    assert bool(silent) is is_lost


def test_what_a_client_has_set_stays_and_everybody_is_told_of_the_rest(world: World) -> None:
    world.client.send(put("TSK_SPEED", 0.8))
    world.client.send(ask(191, "TSK_SPEED"))
    world.run(0.2)
    assert change_and_tell(world, 0.3, 1.5) == [("TSK_SPEED_MAX", 1.5)]
    assert state_of_parameters(world) == ({"TSK_SPEED": 0.8}, ())
    assert change_and_tell(world, 0.3, 0.6) == [("TSK_SPEED", 0.3), ("TSK_SPEED_MAX", 0.6)]
    why = "TSK_SPEED 0.8 is more than TSK_SPEED_MAX 0.6"
    assert state_of_parameters(world) == ({}, (why,))
    assert change_and_tell(world, 0.3, 2.0) == [("TSK_SPEED", 0.8), ("TSK_SPEED_MAX", 2.0)]


def change_and_tell(world: World, speed: float, most: float) -> list[tuple[str, float]]:
    """What the client is told of parameters when the speeds are configured anew."""
    before = len(told(world.client))
    change(world, Settings(driving=Driving(speed=speed, max_speed=most)))
    world.run(0.2)
    return told(world.client)[before:]


def state_of_parameters(world: World) -> tuple[dict[str, float], tuple[str, ...]]:
    return world.server.engine.parameters, world.server.engine.not_in_force
