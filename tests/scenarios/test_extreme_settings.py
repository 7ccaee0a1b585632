"""Whatever the ranges of the settings allow: STOP stops, and the end leaves no rover driving."""

from random import Random

from mav_tasks.config.setting_keys.shapes import Number
from mav_tasks.config.settings import BOUNDED, KEYS, ServerSettings, Settings
from mav_tasks.engine.inputs import Shutdown
from rover_sim.faults import Faults
from rover_sim.personas import Persona
from tests.kit.cases import for_each
from tests.kit.px4 import PROMPT_PX4
from tests.kit.world import PROMPT
from tests.scenarios.conftest import MakeWorld

#: of the stream there are tests; and a rover that has no time to start does not drive at all
LEFT_OUT = ("watch.setpoint_period", "watch.start_timeout")
FRESH = 0.3  # s, beyond which an observer lets nobody drive, whatever the settings say
SPEED = 0.5  # m/s
STOPS = 3.5  # s, from that


def at_the_ends(random: Random) -> Settings:
    """Settings with each time and limit of how it is watched at one end of its range."""
    settings = ServerSettings()
    for name, key in KEYS.items():
        if name.startswith("watch.") and name not in LEFT_OUT and isinstance(key.shape, Number):
            end = random.choice((key.shape.low, key.shape.high))
            settings = key.put(settings, key.shape.kept(end))
    for key, bound in BOUNDED:
        if key.of(settings) > bound.of(settings):
            settings = key.put(settings, bound.of(settings))
    return settings.engine


@for_each("seed", range(4))
@for_each("persona", [PROMPT, PROMPT_PX4])
def test_stop_stops_and_the_end_too(make_world: MakeWorld, persona: Persona, seed: int) -> None:
    settings = at_the_ends(Random(seed))
    world = make_world(seed=seed, persona=persona, settings=settings)
    world.client.move(10.0, speed=SPEED)
    world.until_faster(SPEED / 2, within=30)
    stop = world.client.stop()
    world.until(world.stands, within=STOPS)
    world.until(lambda: world.control() == "IDLE", within=settings.watch.still_time + 1)
    assert stop.result == 0
    assert world.stands()

    world.client.proceed()
    world.client.move(11.0, speed=SPEED)
    world.until_faster(SPEED / 2, within=30)
    if settings.watch.motion_fresh <= FRESH:  # what it does is not seen any more
        world.fault(Faults(silent=True))
        world.run(1.0)
    world.server.pump.handle(Shutdown(), now=world.now)
    world.server.pump.turn(now=world.now)
    world.until(lambda: world.server.pump.is_over, within=settings.watch.shutdown + 0.1)
    world.end_server()
    world.until(world.stands, within=STOPS)
