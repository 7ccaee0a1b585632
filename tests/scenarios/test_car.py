"""A rover that steers as a car, through the whole server: what it drives, and what is said."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import nan
from typing import Any

import pytest

from mav_tasks.config.settings import Settings, VehicleProfile
from mav_tasks.engine.inputs import Shutdown
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.parameters import INT16, Parameter
from rover_sim.personas import Persona
from tests.kit.car import Car
from tests.kit.cases import anew, for_each
from tests.kit.client import DENIED
from tests.kit.px4 import PROMPT_PX4, go_to
from tests.kit.world import PROMPT, World
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_profiles import ARDUPILOT_PROFILE, PX4_PROFILE

RADIUS = 1.2  # m
PROFILES = {"ardupilot": ARDUPILOT_PROFILE, "px4": replace(PX4_PROFILE, yaw_rate="")}

Drive = Callable[..., World]
each = for_each("persona", [PROMPT, PROMPT_PX4])


def car_profile(persona: Persona) -> VehicleProfile:
    return replace(PROFILES[persona.name], turning="steered", turning_radius=RADIUS)


@anew
def make_car(make_world: MakeWorld) -> Drive:
    def make(persona: Persona, **settings_: Any) -> World:
        body = partial(Car, radius=RADIUS)
        settings = Settings(profiles=(car_profile(persona),), **settings_)
        return make_world(persona=persona, settings=settings, body=body)

    return make


def test_who_names_a_heading_reads_that_it_is_left_out(make_car: Drive) -> None:
    world = make_car(PROMPT)
    words = "rover 1 steers like a car: the final heading is ignored"
    go_to(world, 3.0, 1.0, yaw=nan)
    assert not world.client.said(words)
    go_to(world, 8.0, 4.0, yaw=1.0)
    assert world.client.said(words)
    world.until_idle(tasks=2, within=90)
    assert world.state(2)[0] is S.COMPLETED


class TestOneOfWhichNobodyHasAProfile:
    """Its parameters say that it steers as a car: SERVO1_FUNCTION 26."""

    @pytest.fixture
    def world(self, make_world: MakeWorld) -> World:
        outputs = (Parameter("SERVO1_FUNCTION", 26, INT16), Parameter("SERVO3_FUNCTION", 70, INT16))
        car = replace(PROMPT, parameters=(*PROMPT.parameters, *outputs))
        return make_world(persona=car, body=partial(Car, radius=RADIUS))

    def test_a_turn_on_the_spot_is_refused(self, world: World) -> None:
        sent = world.client.rotate(90)
        world.run(0.5)
        assert sent.answer == (DENIED, R.NOT_SUPPORTED_BY_VEHICLE)
        assert world.client.said("steers like a car")


def test_last_words_let_a_px4_brake_and_not_drive_back_to_where_hold_began(make_car: Drive) -> None:
    """A zero alone while it follows setpoints, also while it is braked for the server's end."""
    world = make_car(PROMPT_PX4)
    seen: set[tuple[str, ...]] = set()
    world.client.move(20, speed=1.0)
    world.until_faster(0.9)
    world.server.pump.handle(Shutdown(), now=world.now)
    while world.truth.forward_speed > 0.1:
        seen.add(world.last_words())
        world.run(0.02)
    assert seen == {("zero",)}
