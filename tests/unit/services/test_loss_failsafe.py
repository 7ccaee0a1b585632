from struct import pack, unpack

import pytest

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import ParamValue
from mav_tasks.services.loss_failsafe import ASKS, LossFailsafe

AFTER, ACTION = "COM_OF_LOSS_T", "COM_OBL_RC_ACT"
STICKS, STATION, EXCEPT = "NAV_RCL_ACT", "NAV_DLL_ACT", "COM_DLL_EXCEPT"
REAL32, INT32 = 9, 6
UNKNOWN = "does not report whether it stops when setpoints stop"


def value(name: str, number: float) -> ParamValue:
    """A parameter as PX4 sends it: an integer bytewise."""
    type_, wire = REAL32, number
    if name != AFTER:
        type_ = INT32
        (wire,) = unpack("<f", pack("<i", int(number)))
    return ParamValue(name.encode(), wire, type_, 40, 3)


def failsafe(*values: ParamValue) -> LossFailsafe:
    made = LossFailsafe(Address(1, 1), is_by_parameters=True)
    for each in values:
        made.receive(each)
    return made


def asked(made: LossFailsafe) -> list[str]:
    return [str(request.param_id) for request in made.requests()]


def test_what_decides_is_asked_for_until_it_came_and_what_does_not_is_not() -> None:
    made = failsafe()
    assert asked(made) == [AFTER, ACTION, STICKS, STATION]
    made.receive(value(AFTER, 1.0))
    assert asked(made) == [ACTION, STICKS, STATION]
    made.receive(value(ACTION, 5))
    made.receive(value(STICKS, 1))
    made.receive(value(STATION, 0))
    assert asked(made) == []
    made.receive(value(STATION, 2))
    assert asked(made) == [EXCEPT]


def test_it_is_waited_for_until_it_has_said_all_or_was_asked_in_vain() -> None:
    made = failsafe(value(AFTER, 1.0), value(ACTION, 0))
    assert made.awaits_answer
    made.receive(value(STATION, 0))
    assert made.awaits_answer
    made.receive(value(STICKS, 1))
    assert not made.awaits_answer
    silent = failsafe()
    for _ in range(ASKS):
        assert silent.awaits_answer
        silent.requests()
    assert not silent.awaits_answer


def test_one_that_never_says_is_unknown_and_not_asked_for_ever() -> None:
    made = failsafe()
    asked = [made.requests() for _ in range(ASKS + 3)]
    assert [len(each) for each in asked] == [4] * ASKS + [0] * 3
    assert made.is_unknown
    assert (made.take_news(), made.take_news()) == (UNKNOWN, "")
    assert made.why_off == ""


HOME, LAND = "Return, it drives home", "Land, not known to stop a rover"
ON = "nothing, it keeps driving"


@pytest.mark.parametrize(
    ("after", "action", "sticks", "why"),
    [
        (1.0, 5, 2, ""),
        (5.0, 7, 2, ""),
        (1.0, 6, 2, ""),
        (1.0, 3, 1, f"COM_OBL_RC_ACT is 3: {HOME}"),
        (1.0, 4, 1, f"COM_OBL_RC_ACT is 4: {LAND}"),
        (1.0, -1, 1, f"COM_OBL_RC_ACT is -1: {ON}"),
        (1.0, 0, 2, f"COM_OBL_RC_ACT is 0, NAV_RCL_ACT 2: {HOME}"),  # by default
        (1.0, 2, 2, f"COM_OBL_RC_ACT is 2, NAV_RCL_ACT 2: {HOME}"),
        (1.0, 8, 3, f"COM_OBL_RC_ACT is 8, NAV_RCL_ACT 3: {LAND}"),
        (1.0, 1, 0, f"COM_OBL_RC_ACT is 1, NAV_RCL_ACT 0: {ON}"),
        (1.0, 0, 1, ""),
        (1.0, 0, 6, ""),
        (5.1, 5, 2, "COM_OF_LOSS_T is 5.1 s, more than 5"),
        (60.0, 5, 2, "COM_OF_LOSS_T is 60 s, more than 5"),
    ],
)
def test_whether_it_stops_by_itself(after: float, action: int, sticks: int, why: str) -> None:
    made = failsafe(
        value(AFTER, after), value(ACTION, action), value(STICKS, sticks), value(STATION, 0)
    )
    assert made.why_off == why
    assert made.take_news() == (f"keeps moving when setpoints stop: {why}" if why else "")


@pytest.mark.parametrize(
    ("station", "excepted", "why"),
    [
        (0, 0, ""),
        (1, 0, ""),
        (2, 0, f"NAV_DLL_ACT is 2: {HOME}"),
        (2, 3, f"NAV_DLL_ACT is 2: {HOME}"),
        (2, 4, ""),
        (3, 0, f"NAV_DLL_ACT is 3: {LAND}"),
        (6, 0, ""),
    ],
)
def test_one_that_holds_and_then_misses_its_ground_station(
    station: int, excepted: int, why: str
) -> None:
    made = failsafe(value(AFTER, 1.0), value(ACTION, 5))
    made.receive(value(EXCEPT, excepted))
    made.receive(value(STATION, station))
    assert made.why_off == why


def test_what_it_does_is_said_by_its_name() -> None:
    made = failsafe(value(AFTER, 1.0), value(ACTION, 5), value(STATION, 0))
    assert made.what_it_does == "stops when setpoints stop: Hold"
    made.receive(value(ACTION, 3))
    assert made.what_it_does == (
        "keeps moving when setpoints stop: COM_OBL_RC_ACT is 3: Return, it drives home"
    )


def test_a_change_by_anybody_is_noticed() -> None:
    made = failsafe(value(AFTER, 1.0), value(ACTION, 5))
    made.receive(value(AFTER, 30.0))
    assert made.take_news().startswith("keeps moving")
    made.receive(value(AFTER, 2.0))
    assert (made.take_news(), made.why_off) == ("stops when setpoints stop: Hold", "")


def test_other_parameters_mean_nothing() -> None:
    assert failsafe(value("NAV_ACC_RAD", 60.0)).why_off == ""


def test_after_a_restart_all_is_asked_for_again_and_believed_until_then() -> None:
    made = failsafe(value(AFTER, 1.0), value(ACTION, 5), value(STICKS, 2), value(STATION, 0))
    for _ in range(ASKS + 1):
        made.requests()
    made.forget()
    assert not made.awaits_answer
    assert sorted(asked(made)) == sorted([AFTER, ACTION, STATION, STICKS])
    made.receive(value(ACTION, 3))
    assert made.why_off.startswith("COM_OBL_RC_ACT is 3: Return")
    assert sorted(asked(made)) == sorted([AFTER, STATION, STICKS])


def test_of_one_that_stops_anyhow_nothing_is_asked_or_believed() -> None:
    made = LossFailsafe(Address(1, 1), is_by_parameters=False)
    made.receive(value(AFTER, 60.0))
    made.forget()
    assert (made.requests(), made.why_off, made.take_news()) == ([], "", "")
