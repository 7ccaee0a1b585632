"""Downloads of plans."""

from math import nan
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavMissionResult as Result
from mav_tasks.services.mission_item import Item, item_at, item_of, message_of, packed, unpacked
from mav_tasks.services.mission_receiver import Sender, ToClient
from mav_tasks.services.mission_sender import KEPT, MOST, MissionSender

CLIENT = Sender("client", Address(255, 190), Address(1, 1))
OTHER = Sender("other", Address(255, 190), Address(1, 1))


def plan(*places: int) -> tuple[Item, ...]:
    return tuple(Item(3, 16, 0, 1, 0.0, 0.5, 0.0, nan, x, 8, 1.5) for x in places)


def told(answer: ToClient) -> Any:
    return answer.message


def test_the_count_names_the_plan_and_each_item_is_given_as_it_came() -> None:
    sender = MissionSender()
    count = told(sender.begin(CLIENT, 0, plan(1, 2), opaque_id=17, now=0.0))
    assert (count.count, count.opaque_id, count.mission_type) == (2, 17, 0)
    item = told(sender.request(CLIENT, 0, 1, lambda: (), now=0.1))
    assert isinstance(item, m.MissionItemInt)
    assert (item.seq, item.x, item.param2, item.target_system) == (1, 2, 0.5, 255)


def test_a_download_shows_the_plan_as_it_was_when_it_began() -> None:
    sender = MissionSender()
    sender.begin(CLIENT, 0, plan(1, 2), opaque_id=1, now=0.0)
    sender.begin(OTHER, 0, plan(7), opaque_id=2, now=1.0)
    assert told(sender.request(CLIENT, 0, 0, lambda: plan(7), now=2.0)).x == 1
    assert told(sender.request(OTHER, 0, 0, lambda: plan(9), now=2.0)).x == 7


def test_who_asks_for_an_item_alone_gets_it_of_the_present_plan() -> None:
    assert told(MissionSender().request(CLIENT, 0, 0, lambda: plan(5), now=0.0)).x == 5


def test_an_item_that_is_not_there_is_refused() -> None:
    ack = told(MissionSender().request(CLIENT, 0, 1, lambda: plan(5), now=0.0))
    assert (ack.get_type(), ack.type) == ("MISSION_ACK", Result.INVALID_SEQUENCE)


def test_a_download_that_has_ended_or_is_old_is_forgotten() -> None:
    sender = MissionSender()
    sender.begin(CLIENT, 0, plan(1), opaque_id=1, now=0.0)
    sender.end(CLIENT, 0)
    assert told(sender.request(CLIENT, 0, 0, lambda: plan(2), now=0.0)).x == 2
    sender.begin(OTHER, 0, plan(3), opaque_id=1, now=KEPT + 1)
    assert told(sender.request(CLIENT, 0, 0, lambda: plan(4), now=KEPT + 1)).x == 4


def test_downloads_are_bounded() -> None:
    sender = MissionSender()
    for number in range(3 * MOST):
        who = Sender(number, Address(255, 190), Address(1, 1))
        sender.begin(who, 0, plan(1), opaque_id=1, now=0.0)
    assert repr(sender) == f"MissionSender({MOST} downloads)"


floats = st.floats(width=32)
items = st.builds(
    Item,
    st.integers(0, 255),
    st.integers(0, 65535),
    st.integers(0, 255),
    st.integers(0, 255),
    floats,
    floats,
    floats,
    floats,
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-(2**31), 2**31 - 1),
    floats,
)


@given(st.lists(items, max_size=5))
def test_kept_items_come_back_bit_by_bit(listed: list[Item]) -> None:
    text = packed(listed)
    assert repr(unpacked(text)) == repr(tuple(listed))
    assert repr([item_at(text, n) for n in range(len(listed))]) == repr(listed)


@given(items)
def test_an_item_comes_back_from_its_message(one: Item) -> None:
    assert repr(item_of(message_of(one, 3, 0, to=Address(1, 1)))) == repr(one)
