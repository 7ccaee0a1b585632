"""Which rates are asked of a vehicle, and when again."""

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.services.interval_requester import (
    CHANGES,
    CHANGES_AT_ONCE,
    CHECK,
    MAX_WANTED,
    OPTIONAL,
    SHORTEST,
    TRIES,
    WANTED,
    IntervalRequester,
)


def asked(requester: IntervalRequester, *, now: float, accepted: bool | None = True) -> list[int]:
    """Answer requests until there are no more; gives the message ids asked for."""
    ids: list[int] = []
    while (request := requester.next_request(now=now)) is not None:
        ids.append(int(request.param1))
        requester.answered(accepted=accepted)
    return ids


def hear_everything(
    requester: IntervalRequester, *, seconds: float, but: int | None = None
) -> None:
    for message_id, interval in WANTED.items():
        if message_id != but:
            for _ in range(round(seconds / interval)):
                requester.heard(message_id)


def test_a_new_vehicle_is_asked_for_all_that_is_wanted() -> None:
    assert asked(IntervalRequester(now=0.0), now=0.0) == list(WANTED)


def test_the_control_loop_gets_at_least_20_hz() -> None:
    assert max(WANTED[m.LocalPositionNed.id], WANTED[m.Attitude.id]) <= 1 / 20


def test_one_request_at_a_time() -> None:
    requester = IntervalRequester(now=0.0)
    first = requester.next_request(now=0.0)
    assert first is not None
    assert (first.command, first.param1, first.param2) == (
        MavCmd.SET_MESSAGE_INTERVAL,
        m.LocalPositionNed.id,
        40_000,
    )
    assert requester.next_request(now=0.1) is None
    requester.answered(accepted=True)
    assert requester.next_request(now=0.2) is not None


def test_what_comes_often_enough_is_not_asked_for_again() -> None:
    requester = IntervalRequester(now=0.0)
    asked(requester, now=0.0)
    assert requester.next_deadline() == CHECK
    hear_everything(requester, seconds=CHECK)
    assert asked(requester, now=CHECK) == []
    assert requester.next_deadline() == 2 * CHECK


def test_what_stays_away_is_asked_for_again() -> None:
    requester = IntervalRequester(now=0.0)
    asked(requester, now=0.0)
    hear_everything(requester, seconds=CHECK, but=m.Attitude.id)
    assert asked(requester, now=CHECK) == [m.Attitude.id]


def test_what_was_refused_is_not_asked_for_again() -> None:
    requester = IntervalRequester(now=0.0)
    asked(requester, now=0.0, accepted=False)
    assert asked(requester, now=CHECK) == []


def test_what_was_not_answered_is_asked_for_again() -> None:
    requester = IntervalRequester(now=0.0)
    asked(requester, now=0.0, accepted=None)
    frequent = [number for number, interval in WANTED.items() if CHECK / interval >= 2]
    assert asked(requester, now=CHECK) == [each for each in frequent if each not in OPTIONAL]


def test_what_a_vehicle_may_have_nothing_to_say_in_is_asked_for_again_once_it_came() -> None:
    requester = IntervalRequester(now=0.0)
    asked(requester, now=0.0)
    for number in OPTIONAL:
        requester.heard(number)
    assert set(asked(requester, now=CHECK)) >= OPTIONAL


def test_after_a_restart_of_the_vehicle_everything_is_asked_for_again() -> None:
    requester = IntervalRequester(now=0.0)
    asked(requester, now=0.0, accepted=False)
    requester.ask_all_again()
    assert asked(requester, now=0.5) == list(WANTED)


def test_wishes_can_make_a_rate_higher_but_not_lower() -> None:
    requester = IntervalRequester(now=0.0)
    asked(requester, now=0.0)
    requester.set_wishes({m.Attitude.id: 0.025, m.LocalPositionNed.id: 1.0})
    request = requester.next_request(now=0.1)
    assert request is not None
    assert (request.param1, request.param2) == (m.Attitude.id, 25_000)
    requester.answered(accepted=True)
    assert requester.next_request(now=0.1) is None


def test_what_nobody_wishes_any_more_goes_back() -> None:
    requester = IntervalRequester(now=0.0)
    asked(requester, now=0.0)
    requester.set_wishes({m.Attitude.id: 0.025, 105: 0.5})
    asked(requester, now=0.1)
    requester.set_wishes({})
    intervals = {}
    while (request := requester.next_request(now=0.2)) is not None:
        intervals[request.param1] = request.param2
        requester.answered(accepted=True)
    assert intervals == {m.Attitude.id: 40_000, 105: 0}, "what we need, and the vehicle's default"


def test_that_something_is_to_come_less_often_is_said_again_until_it_is_answered() -> None:
    requester = IntervalRequester(now=0.0)
    asked(requester, now=0.0)
    requester.set_wishes({105: 0.5})
    asked(requester, now=0.1)
    requester.set_wishes({})
    assert asked(requester, now=0.2, accepted=None) == [105] * (1 + TRIES)


def test_wishes_that_stay_are_asked_for_once() -> None:
    requester = IntervalRequester(now=0.0)
    asked(requester, now=0.0)
    for number in range(3):
        requester.set_wishes({105: 0.5})
        assert asked(requester, now=0.1) == ([105] if number == 0 else [])


def test_wishes_that_change_all_the_time_are_asked_for_once_a_second() -> None:
    requester = IntervalRequester(now=0.0)
    count = 0
    for tick in range(600):
        requester.set_wishes({105: 0.5 + 0.1 * (tick % 3)})
        count += len([each for each in asked(requester, now=tick * 0.1) if each == 105])
    assert count <= CHANGES_AT_ONCE + 60 * CHANGES


def test_no_wish_is_for_more_than_a_vehicle_gives() -> None:
    requester = IntervalRequester(now=0.0)
    asked(requester, now=0.0)
    requester.set_wishes({m.Attitude.id: 1e-6})
    request = requester.next_request(now=0.1)
    assert request is not None
    assert request.param2 == SHORTEST * 1e6


def test_a_wish_that_the_vehicle_refuses_does_not_cost_what_the_server_needs() -> None:
    requester = IntervalRequester(now=0.0)
    asked(requester, now=0.0)
    requester.set_wishes({m.Attitude.id: SHORTEST})
    intervals = []
    for accepted in (False, True):
        request = requester.next_request(now=0.1)
        assert request is not None
        intervals.append(request.param2 / 1e6)
        requester.answered(accepted=accepted)
    assert intervals == [SHORTEST, WANTED[m.Attitude.id]]
    requester.set_wishes({m.Attitude.id: SHORTEST})
    assert requester.next_request(now=0.2) is None, "it is known that this is refused"


def test_wishes_are_bounded() -> None:
    requester = IntervalRequester(now=0.0)
    requester.set_wishes(dict.fromkeys(range(1000, 2000), 1.0))
    ids = asked(requester, now=0.0) + asked(requester, now=1000.0)
    assert len(set(ids)) == len(WANTED) + 2 * CHANGES_AT_ONCE
    for second in range(1001, 1100):
        ids += asked(requester, now=float(second))
    assert len(set(ids)) == MAX_WANTED


def test_wishes_for_what_no_vehicle_has_do_not_use_up_the_room() -> None:
    requester = IntervalRequester(now=0.0)
    asked(requester, now=0.0)
    wishes = dict.fromkeys(range(1000, 1064), 1.0)
    for second in range(200):
        requester.set_wishes(wishes)
        asked(requester, now=float(second), accepted=False)
    requester.set_wishes({**wishes, m.VfrHud.id + 1: 1.0})
    assert m.VfrHud.id + 1 in asked(requester, now=300.0)
