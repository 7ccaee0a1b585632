from dataclasses import replace
from math import nan

import pytest

from mav_tasks.mavlink.enums import MavAutopilot, MavModeFlag, MavState, MavType
from mav_tasks.mavlink.messages import Heartbeat
from mav_tasks.services.persona import (
    ARDUPILOT,
    GENERIC,
    PX4,
    Persona,
    persona_of,
    with_turning,
    with_yaw_rate,
)
from mav_tasks.settings import Turning


def heartbeat(autopilot: int) -> Heartbeat:
    return Heartbeat(
        MavType.GROUND_ROVER, autopilot, MavModeFlag.CUSTOM_MODE_ENABLED, 0, MavState.ACTIVE, 3
    )


@pytest.mark.parametrize(
    ("autopilot", "persona"),
    [
        (MavAutopilot.ARDUPILOTMEGA, ARDUPILOT),
        (MavAutopilot.PX4, PX4),
        (MavAutopilot.GENERIC, GENERIC),
        (MavAutopilot.INVALID, None),
        (200, None),
    ],
)
def test_a_persona_is_known_by_the_autopilot_in_the_heartbeat(
    autopilot: int, persona: object
) -> None:
    assert persona_of(heartbeat(autopilot)) is persona


def test_ardupilot_is_asked_for_velocity_and_yaw_rate() -> None:
    assert (ARDUPILOT.setpoint_mask, ARDUPILOT.setpoint_frame) == (0x05C7, 8)


def test_px4_is_asked_for_a_velocity_over_ground_unless_it_turns_at_a_rate() -> None:
    assert (PX4.setpoint_mask, PX4.setpoint_frame, PX4.honours_yaw_rate) == (0x0DC7, 1, False)
    turning = persona_of(heartbeat(MavAutopilot.PX4), honours_yaw_rate=True)
    assert turning is not None
    assert (turning.setpoint_mask, turning.setpoint_frame) == (0x05C7, 8)
    assert (turning.honours_yaw_rate, turning.arms_in_hold) == (True, True)


@pytest.mark.parametrize("persona", [ARDUPILOT, PX4], ids=repr)
def test_how_a_rover_turns_and_how_its_setpoints_are_read_are_two_facts(persona: Persona) -> None:
    car = with_turning(persona, Turning.STEERED, radius=0.9)
    assert (car.turning, car.turning_radius) == (Turning.STEERED, 0.9)
    assert car.honours_yaw_rate is persona.honours_yaw_rate
    for is_honoured in (False, True):
        assert with_yaw_rate(car, is_honoured=is_honoured).turning is Turning.STEERED
    known = with_turning(car, Turning.ON_SPOT)
    assert replace(known, turns_by_course=False) == persona
    assert known.turns_by_course is not persona.honours_yaw_rate
    assert not car.turns_by_course


@pytest.mark.parametrize(
    ("persona", "mode", "params"),
    [
        (ARDUPILOT, 15, (1.0, 15.0, 0.0)),
        (PX4, 0x03040000, (1.0, 4.0, 3.0)),
        (PX4, 0x00060000, (1.0, 6.0, 0.0)),
    ],
)
def test_a_mode_is_asked_for_by_number_or_by_main_and_sub_number(
    persona: object, mode: int, params: tuple[float, float, float]
) -> None:
    assert persona in (ARDUPILOT, PX4)
    chosen = ARDUPILOT if persona is ARDUPILOT else PX4
    assert chosen.mode_params(mode) == params
    assert chosen.mode_in(*params[1:]) == mode


@pytest.mark.parametrize("params", [(nan, 0.0), (-1.0, 0.0), (4.5, 0.0), (256.0, 0.0), (4.0, 300)])
def test_what_are_no_numbers_of_px4_modes(params: tuple[float, float]) -> None:
    assert PX4.mode_in(*params) is None


def test_a_sub_mode_may_be_left_out() -> None:
    assert PX4.mode_in(6.0, nan) == PX4.control_mode
