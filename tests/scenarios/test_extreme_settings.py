"""Whatever the ranges of the settings allow: STOP stops, and the end leaves no rover driving."""

from random import Random

import pytest

from mav_tasks.engine.inputs import Shutdown
from mav_tasks.engine.vehicles.components import Components
from mav_tasks.setting_keys.shapes import HIGHEST_ID, Number
from mav_tasks.settings import BOUNDED, KEYS, ServerSettings, Settings
from rover_sim.faults import Faults
from rover_sim.personas import Persona
from tests.kit.px4 import PROMPT_PX4
from tests.kit.world import PROMPT
from tests.scenarios.conftest import MakeWorld

#: of the stream there are tests; and a rover that has no time to start does not drive at all
LEFT_OUT = ("watch.setpoint_period", "watch.start_timeout")
FRESH = 0.3  # s, beyond which an observer lets nobody drive, whatever the settings say
SPEED = 0.5  # m/s
STOPS = 3.5  # s, from that
COM_OF_LOSS_T = 1.0  # s, of a PX4 that nobody has changed


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


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("persona", [PROMPT, PROMPT_PX4], ids=lambda persona: persona.name)
def test_stop_stops_and_the_end_too(make_world: MakeWorld, persona: Persona, seed: int) -> None:
    settings = at_the_ends(Random(seed))
    world = make_world(seed=seed, persona=persona, settings=settings)
    world.client.move(10.0, speed=SPEED)
    world.until(lambda: world.truth.forward_speed > SPEED / 2, within=30)
    stop = world.client.stop()
    world.until(world.stands, within=STOPS)
    world.until(lambda: world.control() == "IDLE", within=settings.watch.still_time + 1)
    assert stop.result == 0
    assert world.stands()

    world.client.proceed()
    world.client.move(11.0, speed=SPEED)
    world.until(lambda: world.truth.forward_speed > SPEED / 2, within=30)
    if settings.watch.motion_fresh <= FRESH:  # what it does is not seen any more
        world.fault(Faults(silent=True))
        world.run(1.0)
    world.server.pump.handle(Shutdown(), now=world.now)
    world.server.pump.turn(now=world.now)
    world.until(lambda: world.server.pump.is_over, within=settings.watch.shutdown + 0.1)
    world.end_server()
    world.until(world.stands, within=STOPS)


def highest(*names: str) -> Settings:
    """Settings with these at the upper end of their range."""
    settings = ServerSettings()
    for name in names:
        shape = KEYS[name].shape
        assert isinstance(shape, Number)
        settings = KEYS[name].put(settings, shape.kept(shape.high))
    return settings.engine


def test_a_slow_rover_whose_position_stays_behind_is_not_driven_on(make_world: MakeWorld) -> None:
    """Where it counts as standing, nobody sees that its position should change."""
    world = make_world(settings=highest("watch.still_speed"))
    world.client.move(10.0, speed=0.15)
    world.until(lambda: world.truth.forward_speed > 0.12, within=30)
    world.fault(Faults(position_frozen=True))
    north = world.truth.north
    world.run(5.0)
    assert world.truth.north < north + 0.3
    assert world.stands()


def test_a_rover_without_heartbeats_is_not_driven_for_long(make_world: MakeWorld) -> None:
    """Nothing else shows that it is armed, and in our mode."""
    world = make_world(settings=highest("watch.heartbeat_lost"))
    world.client.move(100.0, speed=SPEED)
    world.until(lambda: world.truth.forward_speed > SPEED / 2, within=30)
    world.fault(Faults(withheld=frozenset({0})))
    world.run(12.0)
    assert world.stands()


def test_the_server_has_a_number_among_the_components_of_every_rover() -> None:
    components = Components(1, first=highest("identity.component_id").identity.component_id)
    while (server := components.server.component_id) not in components:
        assert 1 < server <= HIGHEST_ID
        components.note(server)


def test_a_late_server_is_noticed_before_a_px4_has_left_its_mode() -> None:
    assert highest("watch.late_tick").watch.late_tick < COM_OF_LOSS_T
