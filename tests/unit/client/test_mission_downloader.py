"""Fetching plans, to exact times."""

from mav_tasks.client.mission_downloader import ASK_AGAIN, GIVE_UP, MissionDownloader
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavMissionResult as Result
from mav_tasks.services.mission_item import Item, message_of

MISSION, FENCE = 0, 1
ITEMS = tuple(Item(1, 16, 0, 1, 0.0, 0.5, 0.0, 0.0, n, -n, 0.0) for n in range(3))
US = Address(244, 190)


class Rig:
    """A downloader in virtual time, and what it said and learned."""

    def __init__(self) -> None:
        self.downloader = MissionDownloader(Address(1, 1))
        self.said: list[tuple[float, str, int]] = []
        self.got: list[tuple[tuple[Item, ...] | None, Result | None, float]] = []
        self.downloader.begin(MISSION, self.done, now=0.0)
        self.take(0.0)

    def done(self, items: tuple[Item, ...] | None, refused: Result | None, *, now: float) -> None:
        self.got.append((items, refused, now))

    def take(self, now: float) -> None:
        for message in self.downloader.take():
            match message:
                case m.MissionRequestList():
                    self.said.append((now, "list", message.mission_type))
                case m.MissionRequestInt():
                    self.said.append((now, "item", message.seq))
                case m.MissionAck():
                    self.said.append((now, "ack", message.type))

    def receive(self, message: m.Message, now: float) -> None:
        self.downloader.receive(message, now=now)
        self.take(now)

    def run(self, until: float) -> None:
        while (due := self.downloader.next_deadline()) is not None and due <= until:
            self.downloader.handle_deadline(now=due)
            self.take(round(due, 6))


def count(number: int, kind: int = MISSION) -> m.MissionCount:
    return m.MissionCount(*US, number, kind)


def item(seq: int, kind: int = MISSION) -> m.Message:
    return message_of(ITEMS[seq], seq, kind, to=US)


def test_all_items_are_asked_for_in_turn_and_acknowledged() -> None:
    rig = Rig()
    rig.receive(count(3), 0.1)
    for seq in range(3):
        rig.receive(item(seq), 0.2 + seq / 10)
    assert rig.got == [(ITEMS, None, 0.4)]
    assert rig.said == [
        (0.0, "list", MISSION),
        (0.1, "item", 0),
        (0.2, "item", 1),
        (0.30000000000000004, "item", 2),
        (0.4, "ack", Result.ACCEPTED),
    ]
    assert rig.downloader.next_deadline() is None


def test_an_empty_plan_is_one() -> None:
    rig = Rig()
    rig.receive(count(0), 0.1)
    assert rig.got == [((), None, 0.1)]


def test_what_does_not_come_is_asked_for_again_and_given_up_in_the_end() -> None:
    rig = Rig()
    rig.receive(count(3), 0.1)
    rig.receive(item(0), 0.2)
    rig.run(20.0)
    again = [at for at, what, seq in rig.said if (what, seq) == ("item", 1)]
    assert again[:3] == [0.2, 0.2 + ASK_AGAIN, 0.8]
    assert again[-1] < 0.2 + GIVE_UP
    assert rig.got == [(None, None, 0.2 + GIVE_UP)]


def test_copies_strangers_and_other_plans_change_nothing() -> None:
    rig = Rig()
    rig.receive(item(0), 0.05)  # before anybody said how many
    rig.receive(count(3, FENCE), 0.06)
    rig.receive(count(2), 0.1)
    rig.receive(count(3), 0.11)
    rig.receive(item(1), 0.12)
    rig.receive(item(0, FENCE), 0.13)
    rig.receive(item(0), 0.2)
    rig.receive(item(0), 0.21)
    rig.receive(item(1), 0.3)
    assert rig.got == [(ITEMS[:2], None, 0.3)]


def test_a_refusal_is_told_by_its_result() -> None:
    rig = Rig()
    rig.receive(m.MissionAck(*US, Result.DENIED, MISSION), 0.1)
    assert rig.got == [(None, Result.DENIED, 0.1)]
    rig.receive(m.MissionAck(*US, 99, MISSION), 0.2)
    assert len(rig.got) == 1
