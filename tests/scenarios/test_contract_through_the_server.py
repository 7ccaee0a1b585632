"""A rover behind the server is still one: check_vehicle judges what a client sees of it.

All that the checker may do to a rover it does: it arms.
"""

import asyncio

from mav_tasks.shell.in_memory import CLIENT_LINK
from rover_sim.check_vehicle.contract import check_all
from rover_sim.observing.observer import Observer
from rover_sim.personas import PERSONAS, Mode
from rover_sim.testing.virtual_loop import VirtualLoop
from tests.kit.cases import for_each
from tests.scenarios.conftest import MakeWorld

#: the server owns the rates on the vehicle link, and takes any interval for itself
KNOWN = {"interval of an unknown message"}


@for_each("name", PERSONAS)
def test_a_rover_behind_the_server_passes_as_it_does_without(
    make_world: MakeWorld, name: str
) -> None:
    world = make_world(persona=PERSONAS[name])
    loop = VirtualLoop(world)
    loop.allow(300.0, real_seconds=60.0)

    async def run() -> dict[str, object]:
        observer = Observer(world.net.link("checker", peers=(CLIENT_LINK,)), keeps=True)
        checked = [each async for each in check_all(observer, may_arm=True)]
        observer.close()
        return {check.name: value for check, value in checked if check.is_right(value) is not True}

    with asyncio.Runner(loop_factory=lambda: loop) as runner:
        failed = runner.run(run())
    assert set(failed) == KNOWN, failed
    assert (world.mode(), world.is_armed) == (Mode.HOLD, False)
