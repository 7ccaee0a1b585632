"""What asks a vehicle to stand as it is, by its make and by what is seen of it."""

import pytest

from mav_tasks.services.orders import (
    BRAKING_SPEED,
    STANDING,
    Posture,
    Speeds,
    to_stand,
)
from mav_tasks.services.persona import ARDUPILOT, PX4, Persona, with_turning
from mav_tasks.settings import Turning

SKID = with_turning(ARDUPILOT, Turning.ON_SPOT)
CAR = with_turning(ARDUPILOT, Turning.STEERED)


@pytest.mark.parametrize("persona", [SKID, CAR, PX4], ids=["skid", "car", "px4"])
def test_one_that_is_not_armed_gets_plain_zeros(persona: Persona) -> None:
    posture = Posture(1.0, rolls=True, stick=1)
    assert to_stand(persona, posture, armed=False) == STANDING


@pytest.mark.parametrize("persona", [SKID, CAR], ids=["skid", "car"])
@pytest.mark.parametrize(("stick", "forward"), [(1, -BRAKING_SPEED), (-1, BRAKING_SPEED)])
def test_an_ardupilot_is_braked_against_its_throttle_stick(
    persona: Persona, stick: int, forward: float
) -> None:
    assert to_stand(persona, Posture(stick=stick), armed=True) == Speeds(forward)


def test_only_a_car_that_still_rolls_is_braked_by_its_speed_loop() -> None:
    assert to_stand(CAR, Posture(rolls=True), armed=True) == Speeds(BRAKING_SPEED)
    assert to_stand(CAR, Posture(), armed=True) == STANDING
    assert to_stand(SKID, Posture(rolls=True), armed=True) == STANDING


def test_a_px4_has_no_stick_in_its_offboard_mode() -> None:
    assert to_stand(PX4, Posture(1.0, stick=1), armed=True) == Speeds(0.0, course=1.0)


def test_a_px4_whose_heading_is_not_known_gets_plain_zeros() -> None:
    assert to_stand(PX4, Posture(None, rolls=True), armed=True) == STANDING
