from struct import pack, unpack

import pytest

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import ParamValue
from mav_tasks.services.loss_failsafe import ASKS, LossFailsafe

AFTER, ACTION = "COM_OF_LOSS_T", "COM_OBL_RC_ACT"
REAL32, INT32 = 9, 6
UNKNOWN = "does not say whether it stops when setpoints stop"


def value(name: str, number: float) -> ParamValue:
    """A parameter as PX4 sends it: an integer bytewise."""
    type_, wire = REAL32, number
    if name == ACTION:
        type_ = INT32
        (wire,) = unpack("<f", pack("<i", int(number)))
    return ParamValue(name.encode(), wire, type_, 40, 3)


def failsafe(*values: ParamValue) -> LossFailsafe:
    made = LossFailsafe(Address(1, 1), is_by_parameters=True)
    for each in values:
        made.receive(each)
    return made


def test_both_parameters_are_asked_for_until_they_came() -> None:
    made = failsafe()
    assert [(r.param_id, r.param_index) for r in made.requests()] == [(AFTER, -1), (ACTION, -1)]
    made.receive(value(AFTER, 1.0))
    assert [r.param_id for r in made.requests()] == [ACTION]
    made.receive(value(ACTION, 5))
    assert made.requests() == []


def test_one_that_never_says_is_unknown_and_not_asked_for_ever() -> None:
    made = failsafe()
    asked = [made.requests() for _ in range(ASKS + 3)]
    assert [len(each) for each in asked] == [2] * ASKS + [0] * 3
    assert made.is_unknown
    assert (made.take_news(), made.take_news()) == (UNKNOWN, "")
    assert made.why_off == ""


@pytest.mark.parametrize(
    ("after", "action", "why"),
    [
        (1.0, 0, ""),
        (5.0, 7, ""),
        (5.1, 5, "COM_OF_LOSS_T is 5.1 s, more than 5"),
        (60.0, 5, "COM_OF_LOSS_T is 60 s, more than 5"),
        (1.0, -1, "COM_OBL_RC_ACT is -1"),
    ],
)
def test_whether_it_stops_by_itself(after: float, action: int, why: str) -> None:
    made = failsafe(value(AFTER, after), value(ACTION, action))
    assert made.why_off == why
    assert made.take_news() == (f"would drive on without setpoints: {why}" if why else "")


def test_a_change_by_anybody_is_noticed() -> None:
    made = failsafe(value(AFTER, 1.0), value(ACTION, 5))
    made.receive(value(AFTER, 30.0))
    assert made.take_news().startswith("would drive on")
    made.receive(value(AFTER, 2.0))
    assert (made.take_news(), made.why_off) == ("stops when setpoints stop", "")


def test_other_parameters_mean_nothing() -> None:
    assert failsafe(value("NAV_ACC_RAD", 60.0)).why_off == ""


def test_after_a_restart_what_is_missing_is_asked_for_again() -> None:
    made = failsafe()
    for _ in range(ASKS + 1):
        made.requests()
    made.forget()
    assert len(made.requests()) == 2


def test_of_one_that_stops_anyhow_nothing_is_asked_or_believed() -> None:
    made = LossFailsafe(Address(1, 1), is_by_parameters=False)
    made.receive(value(AFTER, 60.0))
    made.forget()
    assert (made.requests(), made.why_off, made.take_news()) == ([], "", "")
