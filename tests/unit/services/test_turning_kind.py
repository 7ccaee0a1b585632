"""Whether a rover turns on the spot or steers as a car, read from its parameters."""

from struct import pack, unpack

import pytest

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import ParamValue
from mav_tasks.services.asked_parameters import ASKS
from mav_tasks.services.persona import ARDUPILOT, PX4, Persona
from mav_tasks.services.turning_kind import TurningKind
from mav_tasks.settings import Turning

REAL32, INT32, INT16 = 9, 6, 4


def kind_of(persona: Persona, **values: float) -> TurningKind:
    made = TurningKind(
        Address(1, 1), persona.turning_parameters, is_bytewise=persona.has_bytewise_parameters
    )
    for name, value in values.items():
        wire, type_ = value, REAL32
        if isinstance(value, int):
            type_ = INT16
            if persona is PX4:
                type_ = INT32
                (wire,) = unpack("<f", pack("<i", value))
        made.receive(ParamValue(name.encode(), wire, type_, 10, 3))
    return made


@pytest.mark.parametrize(
    ("values", "turning"),
    [
        ({"SERVO1_FUNCTION": 26, "SERVO3_FUNCTION": 70}, Turning.STEERED),
        ({"SERVO1_FUNCTION": 73, "SERVO3_FUNCTION": 74}, Turning.ON_SPOT),
        ({"SERVO1_FUNCTION": 26, "SERVO3_FUNCTION": 73, "SERVO4_FUNCTION": 74}, Turning.ON_SPOT),
        ({"SERVO1_FUNCTION": 0, "SERVO3_FUNCTION": 70}, None),
        ({}, None),
    ],
)
def test_an_ardupilot_says_it_by_its_outputs(
    values: dict[str, float], turning: Turning | None
) -> None:
    assert kind_of(ARDUPILOT, **values).turning is turning


@pytest.mark.parametrize(
    ("values", "turning"),
    [
        ({"CA_AIRFRAME": 5, "SYS_AUTOSTART": 50990}, Turning.STEERED),
        ({"CA_AIRFRAME": 6}, Turning.ON_SPOT),
        ({"CA_AIRFRAME": 13}, Turning.ON_SPOT),
        ({"CA_AIRFRAME": 0}, None),
        ({"SYS_AUTOSTART": 51001}, Turning.STEERED),
        ({"SYS_AUTOSTART": 50000}, Turning.ON_SPOT),
        ({"SYS_AUTOSTART": 4001}, None),
    ],
)
def test_a_px4_says_it_by_its_airframe(values: dict[str, float], turning: Turning | None) -> None:
    assert kind_of(PX4, **values).turning is turning


def test_its_least_radius_counts_where_it_is_more_than_is_taken_for_granted() -> None:
    assert kind_of(ARDUPILOT, TURN_RADIUS=0.9).radius is None
    assert kind_of(ARDUPILOT, TURN_RADIUS=4.0).radius == 4.0
    assert kind_of(PX4, RA_WHEEL_BASE=2.0, RA_MAX_STR_ANG=0.5).radius == pytest.approx(3.66, 0.01)
    assert kind_of(PX4, RA_WHEEL_BASE=2.0, RA_MAX_STR_ANG=0.0).radius is None


def test_what_it_has_not_said_is_asked_some_times_and_again_after_a_restart() -> None:
    made = kind_of(PX4, CA_AIRFRAME=6)
    asked = [[str(each.param_id) for each in made.requests()] for _ in range(ASKS + 2)]
    assert asked == [["SYS_AUTOSTART", "RA_WHEEL_BASE", "RA_MAX_STR_ANG"]] * ASKS + [[], []]
    made.forget()
    assert len(made.requests()) == 4
    assert made.turning is None
