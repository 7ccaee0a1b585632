"""Plans on their way, to exact times: one after another, and tried again while that is safe."""

from mav_tasks.client.transfers import LATE, PATIENCE, REST, TRIES, Transfers
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavMissionResult as Result
from mav_tasks.services.mission_item import Item, message_of

MISSION, FENCE = 0, 1
ITEMS = (Item(2, 93, 0, 1, 1.0, 0.0, 0.0, 0.0, 0, 0, 0.0),) * 2
US = Address(244, 190)


class Rig:
    """Transfers in virtual time, and what they said and brought."""

    def __init__(self) -> None:
        self.transfers = Transfers(Address(1, 191))
        self.said: list[tuple[float, str]] = []
        self.sent: list[tuple[Result | None, int]] = []
        self.fetched: list[tuple[tuple[Item, ...] | None, Result | None]] = []

    def upload(
        self, kind: int = MISSION, now: float = 0.0, items: tuple[Item, ...] = ITEMS
    ) -> None:
        def done(result: Result | None, opaque_id: int) -> None:
            self.sent.append((result, opaque_id))

        self.transfers.upload(kind, items, done, now=now)
        self.take(now)

    def download(self, kind: int = MISSION, now: float = 0.0) -> None:
        def done(items: tuple[Item, ...] | None, refused: Result | None) -> None:
            self.fetched.append((items, refused))

        self.transfers.download(kind, done, now=now)
        self.take(now)

    def receive(self, message: m.Message, now: float) -> None:
        self.run(now)
        self.transfers.receive(message, now=now)
        self.take(now)

    def take(self, now: float) -> None:
        for message in self.transfers.take():
            name = type(message).__name__.removeprefix("MAVLink_mission_").removesuffix("_message")
            self.said.append((round(now, 3), name))

    def run(self, until: float) -> None:
        while (due := self.transfers.next_deadline()) is not None and due <= until:
            self.transfers.handle_deadline(now=due)
            self.take(due)


def ask(seq: int, kind: int = MISSION) -> m.MissionRequestInt:
    return m.MissionRequestInt(*US, seq, kind)


def ack(result: int, opaque_id: int = 0, kind: int = MISSION) -> m.MissionAck:
    return m.MissionAck(*US, result, kind, opaque_id)


def test_an_upload_brings_the_id_of_the_task() -> None:
    rig = Rig()
    rig.upload()
    rig.receive(ask(0), 0.1)
    rig.receive(ask(1), 0.2)
    rig.receive(ack(Result.ACCEPTED, 17), 0.3)
    assert rig.sent == [(Result.ACCEPTED, 17)]
    assert rig.said == [(0.0, "count"), (0.1, "item_int"), (0.2, "item_int")]


def test_the_last_item_is_sent_once_more_until_there_is_an_answer() -> None:
    rig = Rig()
    rig.upload()
    rig.receive(ask(0), 0.1)
    rig.receive(ask(1), 0.2)
    rig.receive(ack(Result.ACCEPTED, 17), 1.3)
    assert rig.said[2:] == [(0.2, "item_int"), (0.7, "item_int"), (1.2, "item_int")]
    assert rig.sent == [(Result.ACCEPTED, 17)]


def test_silence_and_being_called_off_are_tried_again_so_many_times() -> None:
    rig = Rig()
    rig.upload()
    rig.run(100.0)
    assert rig.sent == [(None, 0)]
    assert rig.transfers.next_deadline() is None
    assert max(at for at, _ in rig.said) < TRIES * PATIENCE.give_up
    rig = Rig()
    rig.upload()
    rig.receive(ack(Result.OPERATION_CANCELLED), 0.1)
    assert (rig.sent, rig.said) == ([], [(0.0, "count"), (0.1, "count")])


def test_a_refusal_is_final() -> None:
    rig = Rig()
    rig.upload()
    rig.receive(ask(0), 0.05)
    rig.receive(ack(Result.DENIED), 0.1)
    assert rig.sent == [(Result.DENIED, 0)]
    rig.run(50.0)
    assert rig.said == [(0.0, "count"), (0.05, "item_int")]


def test_transfers_go_one_after_another() -> None:
    rig = Rig()
    rig.upload()
    rig.download(now=0.05)
    rig.upload(FENCE, now=0.06)
    assert [what for _, what in rig.said] == ["count"]
    rig.receive(ask(1), 0.07)
    rig.receive(ack(Result.ACCEPTED, 17), 0.1)
    del rig.said[1]
    rig.receive(m.MissionCount(*US, 1, MISSION), 0.2)
    rig.receive(message_of(ITEMS[0], 0, MISSION, to=US), 3.0)
    rig.receive(ask(1, FENCE), 3.05)
    rig.receive(ack(Result.ACCEPTED, 0, FENCE), 3.1)
    names = [what for _, what in rig.said]
    assert names[0:2] == ["count", "request_list"]
    assert names[-3:] == ["ack", "count", "item_int"]
    assert rig.fetched == [(ITEMS[:1], None)]
    assert rig.sent == [(Result.ACCEPTED, 17), (Result.ACCEPTED, 0)]


def test_a_copy_of_an_earlier_plans_ack_does_not_end_the_next_one() -> None:
    rig = Rig()
    for at, items in ((0.0, ITEMS), (0.5, ITEMS[:1])):
        rig.upload(items=items, now=at)
        rig.receive(ask(len(items) - 1), at + 0.1)
        rig.receive(ack(Result.ACCEPTED, 17), at + 0.2)
    assert rig.sent == [(Result.ACCEPTED, 17)]
    rig.receive(ack(Result.ACCEPTED, 18), 0.8)
    assert rig.sent[1:] == [(Result.ACCEPTED, 18)]


def test_the_same_plan_again_may_be_the_same_task() -> None:
    rig = Rig()
    for at in (0.0, 0.5):
        rig.upload(now=at)
        rig.receive(ask(1), at + 0.1)
        rig.receive(ack(Result.ACCEPTED, 17), at + 0.2)
    assert rig.sent == [(Result.ACCEPTED, 17)] * 2


def test_an_id_may_come_again_from_a_server_that_began_anew() -> None:
    rig = Rig()
    for at, items in ((0.0, ITEMS), (LATE + 1.0, ITEMS[:1])):
        rig.upload(items=items, now=at)
        rig.receive(ask(len(items) - 1), at + 0.1)
        rig.receive(ack(Result.ACCEPTED, 1), at + 0.2)
    assert rig.sent == [(Result.ACCEPTED, 1)] * 2


def test_after_a_refusal_a_copy_of_it_hits_nobody() -> None:
    rig = Rig()
    rig.upload()
    rig.upload(items=ITEMS[:1])
    rig.receive(ack(Result.INVALID), 0.1)
    rig.receive(ack(Result.INVALID), 0.4)
    assert rig.sent == [(Result.INVALID, 0)]
    rig.run(0.1 + REST)
    assert rig.said == [(0.0, "count"), (round(0.1 + REST, 3), "count")]
