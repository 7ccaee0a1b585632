"""Sending plans to a vehicle, to exact times."""

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavMissionResult as Result
from mav_tasks.services.mission_item import Item
from mav_tasks.services.mission_uploader import (
    TO_VEHICLE,
    MissionUploader,
)

FENCE, RALLY = 1, 2
ITEMS = tuple(Item(0, 5001, 0, 1, 3.0, 0.0, 0.0, 0.0, n, n, 0.0) for n in range(3))


class Rig:
    """An uploader in virtual time, and what it said and learned."""

    def __init__(self) -> None:
        self.uploader = MissionUploader(Address(1, 1))
        self.said: list[tuple[float, str, int]] = []
        self.results: list[tuple[float, Result | None]] = []

    def begin(self, kind: int = FENCE, items: tuple[Item, ...] = ITEMS, now: float = 0.0) -> None:
        self.uploader.begin(kind, items, self.done, now=now)
        self.take(now)

    def done(self, result: Result | None, *, opaque_id: int, now: float) -> None:
        self.results.append((now, result))

    def take(self, now: float) -> None:
        for message in self.uploader.take():
            match message:
                case m.MissionCount():
                    self.said.append((now, "count", message.count))
                case m.MissionItemInt():
                    self.said.append((now, "item", message.seq))

    def receive(self, message: m.Message, now: float) -> None:
        self.uploader.receive(message, now=now)
        self.take(now)

    def run(self, until: float) -> None:
        while (due := self.uploader.next_deadline()) is not None and due <= until:
            self.uploader.handle_deadline(now=due)
            self.take(round(due, 6))


def ask(seq: int, kind: int = FENCE) -> m.MissionRequest:
    return m.MissionRequest(250, 191, seq, kind)


def ack(result: int, kind: int = FENCE) -> m.MissionAck:
    return m.MissionAck(250, 191, result, kind)


def test_what_is_asked_for_is_sent_by_whichever_request() -> None:
    rig = Rig()
    rig.begin()
    rig.receive(ask(0), 0.1)
    rig.receive(m.MissionRequestInt(250, 191, 1, FENCE), 0.2)
    rig.receive(ask(1), 0.3)
    rig.receive(ask(2), 0.4)
    rig.receive(ack(Result.ACCEPTED), 0.5)
    assert [what for _, *what in rig.said] == [
        ["count", 3],
        ["item", 0],
        ["item", 1],
        ["item", 1],
        ["item", 2],
    ]
    assert rig.results == [(0.5, Result.ACCEPTED)]
    assert rig.uploader.next_deadline() is None


def test_it_is_offered_again_and_given_up() -> None:
    rig = Rig()
    rig.begin()
    rig.run(5.0)
    assert rig.said == [(round(TO_VEHICLE.count_again * n, 6), "count", 3) for n in range(5)]
    assert rig.results == [(TO_VEHICLE.give_up, None)]


def test_a_vehicle_that_stops_asking_is_given_up() -> None:
    rig = Rig()
    rig.begin()
    rig.receive(ask(0), 0.5)
    rig.run(5.0)
    assert rig.results == [(0.5 + TO_VEHICLE.give_up, None)]


def test_it_takes_a_limited_time_in_all() -> None:
    rig = Rig()
    rig.begin()
    for at in (0.5, 1.0, 1.5, 1.9):
        rig.receive(ask(0), at)
    rig.run(5.0)
    assert rig.results == [(TO_VEHICLE.at_most, None)]


def test_one_after_the_other() -> None:
    rig = Rig()
    rig.begin()
    rig.begin(RALLY, ITEMS[:1], now=0.1)
    assert rig.said == [(0.0, "count", 3)]
    rig.receive(ack(Result.DENIED), 0.2)
    assert rig.said[1:] == [(0.2, "count", 1)]
    rig.receive(ask(0, RALLY), 0.3)
    rig.receive(ack(Result.ACCEPTED, RALLY), 0.4)
    assert [result for _, result in rig.results] == [Result.DENIED, Result.ACCEPTED]


def test_accepted_before_its_last_item_was_sent_is_an_earlier_ones_answer() -> None:
    rig = Rig()
    rig.begin()
    rig.receive(ask(0), 0.1)
    rig.receive(ask(1), 0.2)
    rig.receive(ack(Result.ACCEPTED), 0.3)
    assert rig.results == []
    rig.receive(ask(2), 0.4)
    rig.receive(ack(Result.ACCEPTED), 0.5)
    assert rig.results == [(0.5, Result.ACCEPTED)]


def test_a_plan_of_nothing_is_accepted_at_once() -> None:
    rig = Rig()
    rig.begin(items=())
    rig.receive(ack(Result.ACCEPTED), 0.1)
    assert rig.results == [(0.1, Result.ACCEPTED)]


def test_answers_about_another_plan_and_numbers_beyond_change_nothing() -> None:
    rig = Rig()
    rig.receive(ack(Result.ACCEPTED), 0.0)
    rig.begin()
    rig.receive(ask(0, RALLY), 0.1)
    rig.receive(ask(9), 0.1)
    rig.receive(ack(Result.ACCEPTED, RALLY), 0.1)
    assert (rig.said[1:], rig.results) == ([], [])
    rig.receive(ack(99), 0.2)
    assert rig.results == [(0.2, Result.ERROR)]
